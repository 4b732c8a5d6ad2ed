within ZeroshotRoom.Parts;
block LimitedPI "PI controller with limits, back-calculation against wind-up, and a switch that makes it stand still"
  parameter Real k = 1 "Gain";
  parameter Real Ti(unit="s") = 3600 "Reset time";
  parameter Real Ni = 0.9 "Ni*Ti is the time constant of the back-calculation";
  parameter Real yMax = 1 "Upper limit of the output; the lower one is 0";
  parameter Boolean still = false "The integrator stands still and the output is 0";

  Modelica.Blocks.Interfaces.RealInput e "Control error";
  Modelica.Blocks.Interfaces.RealOutput y "Limited output";
  Real xI(start=0, fixed=true) "Integrated error";

protected
  Real u "Output before its limits";
equation
  u = k*(e + xI);
  y = if still then 0 else smooth(0, if u < 0 then 0 elseif u > yMax then yMax else u);
  der(xI) = if still then 0 else (e + (y - u)/(k*Ni))/Ti;
end LimitedPI;
