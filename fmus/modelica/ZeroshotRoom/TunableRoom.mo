within ZeroshotRoom;
model TunableRoom "Room whose eight parameters can be set at run time; the weather comes in by the inputs"
  extends BaseClasses.PartialRoom;
  parameter Real dirFix(unit="rad", displayUnit="deg") = 1.3962634015954636
    "Wind direction; at 80 degree the library's factor for a south facade is 0.75, midway between windward and leeward";
protected
  Modelica.Blocks.Sources.RealExpression dirExp(y=dirFix) "Wind direction";
equation
  connect(TDryBul, TOut.u);
  connect(TSky, TBla.u);
  connect(winSpe, vWin.u);
  connect(HFac, HTot.u);
  connect(dirExp.y, dirWin.u);
  annotation (
    experiment(StopTime=31536000, Interval=3600, Tolerance=1e-6),
    Documentation(info="<html>
<p>Has the inputs, outputs, units and estimated parameters of the C twin, so that one system description runs either.
Feed measured actuators (<code>replay</code>) as means over intervals, not as samples.</p>
</html>"));
end TunableRoom;
