within ZeroshotRoom.Data;
record EmissionRate "CO2 of one person"
  parameter Real k(unit="kg/s", min=0) = 9e-6 "CO2 emission rate of one person";
end EmissionRate;
