within ZeroshotRoom;
model Verification "TunableRoom under given inputs, for holding its FMU against the tool's own simulation"
  TunableRoom room "The room";
  Modelica.Blocks.Interfaces.RealOutput TRoo(unit="K") = room.TRoo "Room air temperature";
  Modelica.Blocks.Interfaces.RealOutput CO2(unit="ppm") = room.CO2 "CO2 volume fraction";
  Modelica.Blocks.Interfaces.RealOutput QHea(unit="W") = room.QHea "Heater power";
  Modelica.Blocks.Interfaces.RealOutput mOA(unit="kg/s") = room.mOA "Outdoor air mass flow rate";
protected
  Real day = 2*Modelica.Constants.pi*time/86400 "Angle of the day";
equation
  room.TDryBul = 275.15 - 5*cos(day);
  room.TSky = 262.15 - 5*cos(day);
  room.winSpe = 3 + 2*sin(day/3);
  room.HFac = 200*(1 - cos(day));
  room.CO2Out = 420;
  room.nPer = 14*(1 - cos(day));
  room.TSet = 293.15 - 2*cos(day);
  room.excHea = 300*sin(7*day);
  room.excOut = 0.005*sin(5*day);
  room.QHea_in = 0;
  room.mOA_in = 0;
  room.yWin = 0;
  room.yPlu = 0;
  room.yOff = 0;
  room.ySha = 0;
  annotation (experiment(StopTime=604800, Interval=3600, Tolerance=1e-6));
end Verification;
