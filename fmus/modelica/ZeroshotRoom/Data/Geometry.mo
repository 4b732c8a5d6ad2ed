within ZeroshotRoom.Data;
record Geometry "Plan, height and air volume of a room, each on its own"
  parameter Real AFlo(unit="m2", min=1) = 120.0 "Floor area (square plan)";
  parameter Real hRoo(unit="m", min=0.1) = 3.0 "Room height (sets the wall areas, not the air volume)";
  parameter Real V(unit="m3", min=0.1) = 150.0 "Air volume";
end Geometry;
