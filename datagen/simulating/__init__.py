"""One simulation: instances, integrators, events, and a system as it is drawn."""
