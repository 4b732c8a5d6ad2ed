within ZeroshotRoom.Parts;
model Window "Two panes and what is between them"
  parameter Real A(unit="m2") "Area";
  parameter Real U(unit="W/(m2.K)") "U-value, standard films included";
  parameter Real RFil(unit="m2.K/W") = 0.17 "Standard films contained in the U-value (EN 673, ISO 6946: 0.04 and 0.13)";
  parameter Real CAre(unit="J/(m2.K)") = 1.26e4 "Areal heat capacity of each pane";
  parameter Real T_start(unit="K", displayUnit="degC") = 293.15 "Initial temperature";

  Modelica.Thermal.HeatTransfer.Interfaces.HeatPort_a out "Outer pane";
  Modelica.Thermal.HeatTransfer.Interfaces.HeatPort_b roo "Inner pane";

protected
  Modelica.Thermal.HeatTransfer.Components.HeatCapacitor pan[2](each C=A*CAre, each T(start=T_start, fixed=true))
    "Panes";
  Modelica.Thermal.HeatTransfer.Components.ThermalResistor gap(R=(1/U - RFil)/A) "Between the panes";
equation
  connect(out, pan[1].port);
  connect(pan[1].port, gap.port_a);
  connect(gap.port_b, pan[2].port);
  connect(pan[2].port, roo);
end Window;
