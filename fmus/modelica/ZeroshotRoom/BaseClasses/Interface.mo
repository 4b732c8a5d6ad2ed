within ZeroshotRoom.BaseClasses;
partial model Interface "Inputs and outputs, those of the C twin"
  Modelica.Blocks.Interfaces.RealInput TDryBul(unit="K", displayUnit="degC", start=293.15)
    "Outdoor dry-bulb temperature";
  Modelica.Blocks.Interfaces.RealInput TSky(unit="K", displayUnit="degC", start=283.15) "Black-body sky temperature";
  Modelica.Blocks.Interfaces.RealInput winSpe(unit="m/s", start=3) "Wind speed";
  Modelica.Blocks.Interfaces.RealInput HFac(unit="W/m2", start=0) "Total solar irradiance on the facade";
  Modelica.Blocks.Interfaces.RealInput CO2Out(unit="ppm", start=400) "Outdoor CO2 volume fraction";
  Modelica.Blocks.Interfaces.RealInput nPer(unit="1", start=0) "Number of persons";
  Modelica.Blocks.Interfaces.RealInput TSet(unit="K", displayUnit="degC", start=294.15)
    "Set point of the room air temperature (unused in replay)";
  Modelica.Blocks.Interfaces.RealInput excHea(unit="W", start=0)
    "Excitation added to the heater power after its limiter (unused in replay)";
  Modelica.Blocks.Interfaces.RealInput excOut(unit="kg/s", start=0)
    "Excitation added to the outdoor air flow after its limiter (unused in replay)";
  Modelica.Blocks.Interfaces.RealInput QHea_in(unit="W", start=0) "Heater power, used in replay only";
  Modelica.Blocks.Interfaces.RealInput mOA_in(unit="kg/s", start=0) "Outdoor air mass flow rate, used in replay only";
  Modelica.Blocks.Interfaces.RealInput yWin(unit="1", start=0) "Shape of the window effect: opening, 0 to 1";
  Modelica.Blocks.Interfaces.RealInput yPlu(unit="1", start=0) "Shape of plug loads that follow a timetable, 0 to 1";
  Modelica.Blocks.Interfaces.RealInput yOff(unit="1", start=0) "Shape of the ventilation shut-down, 0 to 1";
  Modelica.Blocks.Interfaces.RealInput ySha(unit="1", start=0) "Shape of moving blinds, 0 to 1";

  Modelica.Blocks.Interfaces.RealOutput TRoo(unit="K", displayUnit="degC") "Room air temperature";
  Modelica.Blocks.Interfaces.RealOutput CO2(unit="ppm") "CO2 volume fraction of the room air, absolute";
  Modelica.Blocks.Interfaces.RealOutput QHea(unit="W") "Heater power";
  Modelica.Blocks.Interfaces.RealOutput mOA(unit="kg/s") "Outdoor air mass flow rate of the ventilation";
  annotation (Documentation(info="<html>
<p>Every input has a start value, because importers that leave one out would otherwise simulate a room at 0 K.</p>
</html>"));
end Interface;
