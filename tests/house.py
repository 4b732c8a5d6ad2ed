"""What descriptions of the small house (``tests/fmus/small/house.c``) have in common."""

ROOM_AND_PERSONS = """
[[outputs]]
name = "room"
variable = "Y"
unit = "degC"
accuracy = 0.01
noise.sensor = { sd = 0.05 }
[occupancy]
headcount = [2, 12]
arrival = [7.0, 9.0]
duration = [8.0, 10.0]
jitter = 0.3
attendance = [0.5, 1.0]
gaps = [1, 1]
gap_duration = [0.5, 1.0]
gap_share = [0.5, 1.0]
absence = 0.05
weekend = 0.1
"""
"""Its one output and who is in it: tables to end a description with."""
