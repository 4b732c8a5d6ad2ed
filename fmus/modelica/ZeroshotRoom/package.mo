within ;
package ZeroshotRoom "A room with CO2 whose eight estimated parameters can be set in its FMU, on the Buildings library"

  annotation (
    version="1.0.0",
    versionDate="2026-11-21",
    uses(Modelica(version="4.1.0"), Buildings(version="14.0.0")),
    Documentation(info="<html>
<p>Two models of one room, for estimating its parameters from measurements.</p>
<ul>
<li><code>TunableRoom</code> (and <code>TunableRoomWeatherFile</code>) keeps the library's room air, convection, long-wave
exchange and gains, and puts walls, window and outdoor exchange of its own around them, so that every estimated
parameter acts at run time. It has the interface of the C twin, variable by variable.</li>
<li><code>OriginalExample</code> extends the library's example <code>MixedAirCO2</code> and adds a heating loop, persons and
excitation. Its parameters are reachable by the names that act, and some of them cannot reach the outputs: see there.</li>
</ul>
</html>"));
end ZeroshotRoom;
