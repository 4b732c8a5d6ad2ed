"""What drives a simulated system: weather, occupancy, schedules, excitation, as tables of knots; and random streams."""
