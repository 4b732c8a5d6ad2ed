within ZeroshotRoom.BaseClasses;
partial model PartialRoom "The room without its weather"
  extends Interface;

  replaceable package Medium = Buildings.Media.Air(extraPropertiesNames={"CO2"})
    constrainedby Modelica.Media.Interfaces.PartialMedium "Moist air with CO2";

  // The eight estimated parameters, under the names of the paper's Table 1
  parameter Data.EmissionRate gaiCO2 "CO2 of the persons";
  parameter Data.Geometry roo "Geometry";
  parameter Data.ExternalWall matExtWal "Opaque facade";
  parameter Data.Glazing glaSys "Window";
  parameter Real mOut_flow(unit="kg/s", min=1e-6) = 0.15
    "Outdoor air mass flow rate at the lower limit of the CO2 controller";

  parameter Boolean replay = false
    "QHea_in and mOA_in replace both control loops, whose integrators stand still";
  parameter Data.Effects effect "What the room leaves out; all zero by default";

  // Start, persons, sun
  parameter Real T_start(unit="K", displayUnit="degC") = 293.15 "Initial temperature of air, walls and panes";
  parameter Real CO2_start(unit="ppm") = 400.0 "Initial CO2 volume fraction of the room air";
  parameter Real QPer(unit="W") = 120.0 "Metabolic heat of a person: 40 % radiant, 40 % convective, 20 % latent";
  parameter Real fraWin(unit="1") = 0.4 "Window share of the facade area";
  parameter Real fraSolFlo(unit="1") = 0.8 "Share of the transmitted sun that the floor absorbs";
  parameter Real refSol(unit="1") = 0.15 "Solar reflectance of the window";
  parameter Real absSolFac(unit="1") = 0.6 "Solar absorptance of the opaque facade";

  // Control
  parameter Real QHea_max(unit="W") = 10000.0 "Largest heater power under control";
  parameter Real dCO2Set(unit="ppm") = 700.0 "CO2 set point above outdoors";
  Parts.LimitedPI conCO2(k=5.0, Ti=120.0, yMax=10.0, still=replay) "Outdoor air by CO2";
  Parts.LimitedPI conHea(k=0.25, Ti=14400.0, yMax=1.0, still=replay) "Heating by temperature";

  // Areas; expressions of parameters that can be set can be set through them
  final parameter Real AFac(unit="m2") = sqrt(roo.AFlo)*roo.hRoo "Facade, and each inner wall";
  final parameter Real AWin(unit="m2") = fraWin*AFac "Window";
  final parameter Real AOpa(unit="m2") = (1 - fraWin)*AFac "Opaque part of the facade";

  // Constructions: areal capacities of the twin's default layers, shared out to three nodes
  Parts.Wall flo(A=roo.AFlo, CAre={10529.95, 15127.87, 5586.58}, R=0.285, T_start=T_start) "Floor";
  Parts.Wall cei(A=roo.AFlo, CAre={9030.79, 7231.39, 16360.02}, R=3.0024861, T_start=T_start) "Ceiling";
  Parts.Wall inn[3](
    each A=AFac,
    each CAre={3241.23, 6912.77, 16260.90},
    each R=2.9233194,
    each T_start=T_start) "Inner walls";
  Parts.Wall fac(A=AOpa, CAre={13553.83, 6792.09, 3254.88}, R=matExtWal.R, T_start=T_start) "Opaque facade";
  Parts.Window win(A=AWin, U=glaSys.UFra, T_start=T_start) "Window";

  // The library's room: air, convection, long-wave exchange, gains. No construction inside it, so that floor area and
  // height reach its volume alone and the volume is free of them; V itself is final there.
  Buildings.ThermalZones.Detailed.MixedAir zon(
    redeclare package Medium = Medium,
    nConExt=0,
    nConExtWin=0,
    nConPar=0,
    nConBou=0,
    nSurBou=7,
    surBou(
      A={roo.AFlo, roo.AFlo, AFac, AFac, AFac, AOpa, AWin},
      each absIR=0.9,
      each absSol=0.9,
      til={Buildings.Types.Tilt.Floor, Buildings.Types.Tilt.Ceiling, Buildings.Types.Tilt.Wall,
           Buildings.Types.Tilt.Wall, Buildings.Types.Tilt.Wall, Buildings.Types.Tilt.Wall,
           Buildings.Types.Tilt.Wall}),
    AFlo=roo.AFlo,
    hRoo=roo.V/roo.AFlo,
    linearizeRadiation=false,
    intConMod=Buildings.HeatTransfer.Types.InteriorConvection.Temperature,
    use_C_flow=true,
    nPorts=3,
    energyDynamics=Modelica.Fluid.Types.Dynamics.FixedInitial,
    T_start=T_start,
    C_start={CO2_start/ppmPer},
    C_nominal={1e-3}) "Room air with its surfaces";
  Modelica.Blocks.Sources.RealExpression gai[3](
    y={0.4*QPer/roo.AFlo*nPer, 0.4*QPer/roo.AFlo*nPer, 0.2*QPer/roo.AFlo*nPer}) "Radiant, convective and latent gains [W/m2]";
  Modelica.Blocks.Sources.RealExpression gaiMas(y=gaiCO2.k*nPer) "CO2 of the persons [kg/s]";
  Modelica.Blocks.Sources.RealExpression gaiAir(y=QHea + QEff) "Heater and effects, to the air [W]";
  Modelica.Thermal.HeatTransfer.Sources.PrescribedHeatFlow heaAir "To the air";

  // Outdoor air: an exhaust fan draws it through a duct
  Buildings.Fluid.Sources.MassFlowSource_T fan(
    redeclare package Medium = Medium,
    use_m_flow_in=true,
    nPorts=1) "Exhaust";
  Buildings.Fluid.Sources.Boundary_pT out(
    redeclare package Medium = Medium,
    use_T_in=true,
    use_C_in=true,
    nPorts=1) "Outdoor air";
  Buildings.Fluid.FixedResistances.PressureDrop duc(
    redeclare package Medium = Medium,
    allowFlowReversal=false,
    linearized=true,
    from_dp=true,
    dp_nominal=100,
    m_flow_nominal=0.5) "Keeps the pressures of room and outdoors apart";
  Buildings.Fluid.Sensors.PPM senCO2(
    redeclare package Medium = Medium,
    warnAboutOnePortConnection=false) "CO2 of the room air";
  Modelica.Blocks.Sources.RealExpression mExh(y=-((1 - effect.mixing.bypass)*mOA + mInf)) "Exhaust [kg/s]";
  Modelica.Blocks.Sources.RealExpression XOut(y=CO2Out/ppmPer) "CO2 mass fraction outdoors";

  // Outdoor side of facade and window
  Buildings.HeatTransfer.Convection.Exterior conFac(
    A=AOpa,
    conMod=Buildings.HeatTransfer.Types.ExteriorConvection.TemperatureWind,
    roughness=Buildings.HeatTransfer.Types.SurfaceRoughness.Medium,
    til=Buildings.Types.Tilt.Wall,
    azi=Buildings.Types.Azimuth.S) "Convection at the opaque facade";
  Buildings.HeatTransfer.Convection.Exterior conWin(
    A=AWin,
    conMod=Buildings.HeatTransfer.Types.ExteriorConvection.TemperatureWind,
    roughness=Buildings.HeatTransfer.Types.SurfaceRoughness.VerySmooth,
    til=Buildings.Types.Tilt.Wall,
    azi=Buildings.Types.Azimuth.S) "Convection at the window";
  Buildings.ThermalZones.Detailed.BaseClasses.SkyRadiationExchange sky(
    n=2,
    A={AOpa, AWin},
    vieFacSky={0.5, 0.5},
    absIR={0.9, 0.9}) "Long-wave exchange with sky and surroundings";
  Modelica.Thermal.HeatTransfer.Sources.PrescribedTemperature amb "Outdoor air at the facade";

  // Sun: opaque facade, outer pane, inner pane, floor, ceiling, three inner walls
  Modelica.Thermal.HeatTransfer.Sources.PrescribedHeatFlow sol[8] "Absorbed sun";
  Modelica.Blocks.Sources.RealExpression solAbs[8](
    y={HSun*absSolFac*AOpa, HSun*0.5*glaSys.absSolFra*AWin, HSun*0.5*glaSys.absSolFra*AWin,
       HSun*fraSolFlo*tauSol*AWin, HSun*solRest*roo.AFlo, HSun*solRest*AFac, HSun*solRest*AFac,
       HSun*solRest*AFac}) "Absorbed sun [W]";

  // Weather, connected by the models that extend this one
  Modelica.Blocks.Routing.RealPassThrough TOut "Outdoor temperature [K]";
  Modelica.Blocks.Routing.RealPassThrough TBla "Sky temperature [K]";
  Modelica.Blocks.Routing.RealPassThrough vWin "Wind speed [m/s]";
  Modelica.Blocks.Routing.RealPassThrough dirWin "Wind direction [rad], 0 from north";
  Modelica.Blocks.Routing.RealPassThrough HTot "Total irradiance on the facade [W/m2]";

  Real mInf(unit="kg/s") "Infiltration (an effect)";
  Real QEff(unit="W") "Heat to the air by the other effects";

protected
  final parameter Real ppmPer = 1e6*Medium.molarMass(
    Medium.setState_pTX(Medium.p_default, Medium.T_default, Medium.X_default))/
    Modelica.Media.IdealGases.Common.SingleGasesData.CO2.MM "Volume fraction [ppm] for a mass fraction, as the sensor has it";
  Real tauSol = 1 - refSol - glaSys.absSolFra "Solar transmittance of the window";
  Real solRest = (1 - fraSolFlo)*tauSol*AWin/(roo.AFlo + 3*AFac) "Share of ceiling and inner walls, for their area";
  Real HSun(unit="W/m2") "Irradiance that is left of it after shading";
  Real dTOut(unit="K") "Size of the temperature difference to outdoors, rounded off at zero";
equation
  TRoo = zon.heaPorAir.T;
  CO2 = senCO2.ppm;
  conHea.e = TSet - TRoo;
  conCO2.e = (CO2 - CO2Out - dCO2Set)/dCO2Set;
  QHea = smooth(0, max(0, if replay then QHea_in else QHea_max*(1 - effect.heater.derate)*conHea.y + excHea)) +
    (if replay then 0 else effect.valve.Q);
  mOA = smooth(0, max(0, if replay then mOA_in else mOut_flow*(1 + conCO2.y) + excOut))*
    (1 - yOff*effect.shutdown.fra);

  dTOut = sqrt((TRoo - TOut.y)^2 + 1e-4) - 1e-2;
  mInf = effect.infiltration.m0 + effect.infiltration.cWind*vWin.y + effect.infiltration.cStack*dTOut + yWin*(
    effect.window.m0 + effect.window.cStack*dTOut);
  QEff = effect.bridge.UA*(TOut.y - TRoo) + effect.adjacent.UA*(effect.adjacent.T - TRoo) + effect.plug.Q + yPlu*
    effect.timetable.Q;
  HSun = HTot.y*(1 - effect.shading.fra)*(1 - ySha*effect.blinds.fra);

  connect(gai.y, zon.qGai_flow);
  connect(gaiMas.y, zon.C_flow[1]);
  connect(gaiAir.y, heaAir.Q_flow);
  connect(heaAir.port, zon.heaPorAir);

  connect(mExh.y, fan.m_flow_in);
  connect(fan.ports[1], zon.ports[1]);
  connect(TOut.y, out.T_in);
  connect(XOut.y, out.C_in[1]);
  connect(out.ports[1], duc.port_a);
  connect(duc.port_b, zon.ports[2]);
  connect(senCO2.port, zon.ports[3]);

  connect(flo.roo, zon.surf_surBou[1]);
  connect(cei.roo, zon.surf_surBou[2]);
  for i in 1:3 loop
    connect(inn[i].roo, zon.surf_surBou[2 + i]);
    connect(sol[5 + i].port, inn[i].roo);
  end for;
  connect(fac.roo, zon.surf_surBou[6]);
  connect(win.roo, zon.surf_surBou[7]);

  connect(TOut.y, amb.T);
  connect(amb.port, conFac.fluid);
  connect(amb.port, conWin.fluid);
  connect(conFac.solid, fac.far);
  connect(conWin.solid, win.out);
  connect(vWin.y, conFac.v);
  connect(vWin.y, conWin.v);
  connect(dirWin.y, conFac.dir);
  connect(dirWin.y, conWin.dir);
  connect(TOut.y, sky.TOut);
  connect(TBla.y, sky.TBlaSky);
  connect(sky.port[1], fac.far);
  connect(sky.port[2], win.out);

  connect(solAbs.y, sol.Q_flow);
  connect(sol[1].port, fac.far);
  connect(sol[2].port, win.out);
  connect(sol[3].port, win.roo);
  connect(sol[4].port, flo.roo);
  connect(sol[5].port, cei.roo);
  annotation (Documentation(info="<html>
<p>What keeps each parameter alive when the FMU runs:</p>
<ul>
<li><code>gaiCO2.k</code>, <code>matExtWal.R</code>, <code>glaSys.UFra</code>, <code>glaSys.absSolFra</code> are fields of plain
records and enter resistances and flow rates, not the library's material and glazing records, which are evaluated at
compile time.</li>
<li><code>roo.AFlo</code> and <code>roo.hRoo</code> set the areas of walls and window; <code>roo.V</code> alone sets the air volume.
In the library's room the volume is floor area times height, and the gains are given per floor area; so it gets
<code>hRoo = V/AFlo</code>, and the persons' gains are divided by the area that it multiplies them with.</li>
<li><code>glaSys.UFra</code> and <code>glaSys.absSolFra</code> are the window's U-value and absorptance here. In the unadapted
example they belong to a frame that takes a share of 1e-6 of the window, and cannot be seen in any output.</li>
<li><code>mOut_flow</code> is what the fan moves at the lower limit of the CO2 loop.</li>
</ul>
<p>A wall takes <code>matExtWal.R</code> as a whole and not as one layer's resistance.</p>
</html>"));
end PartialRoom;
