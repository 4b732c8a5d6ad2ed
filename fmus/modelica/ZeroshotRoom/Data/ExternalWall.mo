within ZeroshotRoom.Data;
record ExternalWall "Opaque part of the facade"
  parameter Real R(unit="m2.K/W", min=1e-3) = 1.5 "Surface-to-surface thermal resistance of the opaque facade";
end ExternalWall;
