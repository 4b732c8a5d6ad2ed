within ZeroshotRoom;
model OriginalExample "The library's MixedAirCO2 with a heating loop, persons as input and excitation"
  extends Buildings.ThermalZones.Detailed.Examples.MixedAirCO2(
    AFlo=120.0,
    mOut_flow=0.15,
    gaiCO2(k=9e-6),
    nPer(amplitude=0),
    conPI(yMax=yMaxCO2),
    weaDat1(filNam=filNam),
    roo(
      hRoo=hRoo,
      nPorts=5,
      datConExtWin(
        each A=sqrt(AFlo)*hRoo,
        each hWin=hRoo,
        each wWin=fraWin*sqrt(AFlo)),
      datConBou(A={AFlo, AFlo, sqrt(AFlo)*hRoo, sqrt(AFlo)*hRoo, sqrt(AFlo)*hRoo})));

  parameter Real hRoo(unit="m") = 3.0 "Room height";
  parameter Real fraWin(unit="1") = 0.4 "Window share of the facade area";
  parameter Real QHea_max(unit="W") = 10000.0 "Largest heater power under control";
  parameter Real QPer(unit="W") = 120.0 "Metabolic heat of a person, of which 40 % is radiant and 40 % convective";
  parameter Real yMaxCO2 = 10.0 "Upper limit of the CO2 controller; 0 switches it off (the paper's section 2.3, step 1)";
  parameter String filNam = Modelica.Utilities.Files.loadResource(
    "modelica://Buildings/Resources/weatherdata/USA_IL_Chicago-OHare.Intl.AP.725300_TMY3.mos") "Weather file";

  Modelica.Blocks.Interfaces.RealInput nPersons(unit="1", start=0) "Number of persons (nPer is the example's own pulse)";
  Modelica.Blocks.Interfaces.RealInput CO2Out(unit="ppm", start=400) "Outdoor CO2 volume fraction, added to the output";
  Modelica.Blocks.Interfaces.RealInput TSet(unit="K", displayUnit="degC", start=294.15)
    "Set point of the room air temperature";
  Modelica.Blocks.Interfaces.RealInput excHea(unit="W", start=0) "Excitation added to the heater power";
  Modelica.Blocks.Interfaces.RealInput excOut(unit="kg/s", start=0) "Excitation added to the exhaust";

  Modelica.Blocks.Interfaces.RealOutput TRoo(unit="K", displayUnit="degC") "Room air temperature";
  Modelica.Blocks.Interfaces.RealOutput CO2(unit="ppm") "CO2 volume fraction of the room air, absolute";
  Modelica.Blocks.Interfaces.RealOutput QHea(unit="W") "Heater power";
  Modelica.Blocks.Interfaces.RealOutput mOA(unit="kg/s") "Outdoor air mass flow rate";

  Parts.LimitedPI conHea(k=0.25, Ti=14400.0, yMax=1.0) "Heating by temperature";
  Modelica.Thermal.HeatTransfer.Sources.PrescribedHeatFlow heaAir "Heater and persons, convective";
  Modelica.Thermal.HeatTransfer.Sources.PrescribedHeatFlow heaRad "Persons, radiant";
  Buildings.Fluid.Sources.TraceSubstancesFlowSource souCO2(
    redeclare package Medium = MediumA,
    substanceName="CO2",
    use_m_flow_in=true,
    nPorts=1) "CO2 of the persons";
  Buildings.Fluid.Sources.MassFlowSource_T fanExc(
    redeclare package Medium = MediumA,
    use_m_flow_in=true,
    nPorts=1) "Exhaust of the excitation";
  Modelica.Blocks.Sources.RealExpression mCO2Per(y=gaiCO2.k*nPersons) "CO2 of the persons [kg/s]";
  Modelica.Blocks.Sources.RealExpression mExc(y=-excOut) "Flow of the excitation into the room [kg/s]";
equation
  TRoo = roo.heaPorAir.T;
  CO2 = CO2Out + senCO2.ppm;
  conHea.e = TSet - TRoo;
  QHea = smooth(0, max(0, QHea_max*conHea.y + excHea));
  mOA = bou.ports[1].m_flow + excOut;
  heaAir.Q_flow = QHea + 0.4*QPer*nPersons;
  heaRad.Q_flow = 0.4*QPer*nPersons;
  connect(mCO2Per.y, souCO2.m_flow_in);
  connect(mExc.y, fanExc.m_flow_in);
  connect(heaAir.port, roo.heaPorAir);
  connect(heaRad.port, roo.heaPorRad);
  connect(souCO2.ports[1], roo.ports[4]);
  connect(fanExc.ports[1], roo.ports[5]);
  annotation (
    experiment(StopTime=31536000, Interval=3600, Tolerance=1e-6),
    Documentation(info="<html>
<p>The library's room as it is: facade with an electrochromic window, five surfaces to boundaries, the CO2 loop that
raises the exhaust. Persons come by an input: their heat by the heat ports, their CO2 by a source of its own; their
latent heat is left out. Weather is a file.</p>
<p><b>Names that act</b> once it is compiled, and what they can do:</p>
<table border=\"1\" summary=\"live parameters\">
<tr><th>the paper's name</th><th>name in the FMU</th><th>effect</th></tr>
<tr><td>gaiCO2.k</td><td>gaiCO2.k</td><td>CO2</td></tr>
<tr><td>roo.AFlo, roo.hRoo</td><td>AFlo, hRoo</td><td>areas of this model, and the volume</td></tr>
<tr><td>roo.V</td><td>none</td><td>final in the library, AFlo times hRoo</td></tr>
<tr><td>matExtWal.R</td><td>roo.datConExtWin[1].layers.material[3].R</td><td>insulation of the facade</td></tr>
<tr><td>glaSys.UFra</td><td>roo.datConExtWin[1].glaSys.UFra</td><td>the frame, a share of 1e-6 of the window: 2e-4 K</td></tr>
<tr><td>glaSys.absSolFra</td><td>roo.datConExtWin[1].glaSys.absSolFra</td><td>the frame: nothing that can be measured</td></tr>
<tr><td>mOut_flow</td><td>mOut_flow</td><td>temperature and CO2</td></tr>
</table>
<p>The records <code>matExtWal</code> and <code>glaSys</code> at the top appear in the FMU, accept new values and ignore them. In the
example without this model's areas, floor area and height reach the outputs through the volume alone, so that the three
geometric parameters cannot be told apart.</p>
</html>"));
end OriginalExample;
