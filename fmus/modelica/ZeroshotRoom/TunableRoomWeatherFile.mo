within ZeroshotRoom;
model TunableRoomWeatherFile "The same room with the weather of a TMY3 file; its four weather inputs are not used"
  extends BaseClasses.PartialRoom;
  parameter String filNam = "weather.mos" "Weather file (TMY3 in Modelica's form)";
  parameter Real albedo(unit="1") = 0.2 "Reflectance of the ground";

  Buildings.BoundaryConditions.WeatherData.ReaderTMY3 weaDat(filNam=filNam) "Weather";
  Buildings.BoundaryConditions.WeatherData.Bus weaBus "Weather";
  Buildings.BoundaryConditions.SolarIrradiation.DirectTiltedSurface HDir(
    til=Buildings.Types.Tilt.Wall,
    azi=Buildings.Types.Azimuth.S) "Direct irradiance on the facade";
  Buildings.BoundaryConditions.SolarIrradiation.DiffusePerez HDif(
    til=Buildings.Types.Tilt.Wall,
    azi=Buildings.Types.Azimuth.S,
    rho=albedo) "Diffuse irradiance on the facade";
  Modelica.Blocks.Math.Add HSum "Total irradiance on the facade";
equation
  connect(weaDat.weaBus, weaBus);
  connect(weaBus, HDir.weaBus);
  connect(weaBus, HDif.weaBus);
  connect(weaBus.TDryBul, TOut.u);
  connect(weaBus.TBlaSky, TBla.u);
  connect(weaBus.winSpe, vWin.u);
  connect(weaBus.winDir, dirWin.u);
  connect(HDir.H, HSum.u1);
  connect(HDif.H, HSum.u2);
  connect(HSum.y, HTot.u);
  annotation (
    experiment(StopTime=31536000, Interval=3600, Tolerance=1e-6),
    Documentation(info="<html>
<p>A literal file name can be set in the FMU, and the file is read where the FMU runs. A name made with
<code>loadResource</code> would put the file into the FMU and could not be set any more.</p>
</html>"));
end TunableRoomWeatherFile;
