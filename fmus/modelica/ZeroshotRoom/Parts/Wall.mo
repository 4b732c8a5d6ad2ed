within ZeroshotRoom.Parts;
model Wall "One-dimensional conduction through a layered wall with three nodes"
  parameter Real A(unit="m2") "Area";
  parameter Real CAre[3](each unit="J/(m2.K)")
    "Areal heat capacity of the nodes at the far surface, in the middle, at the room's surface";
  parameter Real R(unit="m2.K/W") "Thermal resistance from surface to surface";
  parameter Real T_start(unit="K", displayUnit="degC") = 293.15 "Initial temperature";

  Modelica.Thermal.HeatTransfer.Interfaces.HeatPort_a far "Far surface; adiabatic where nothing is connected";
  Modelica.Thermal.HeatTransfer.Interfaces.HeatPort_b roo "Room-side surface";

protected
  Modelica.Thermal.HeatTransfer.Components.HeatCapacitor nod[3](
    C={A*CAre[1], A*CAre[2], A*CAre[3]},
    each T(start=T_start, fixed=true)) "Heat capacities";
  Modelica.Thermal.HeatTransfer.Components.ThermalResistor con[2](each R=0.5*R/A) "Conduction between the nodes";
equation
  connect(far, nod[1].port);
  connect(nod[1].port, con[1].port_a);
  connect(con[1].port_b, nod[2].port);
  connect(nod[2].port, con[2].port_a);
  connect(con[2].port_b, nod[3].port);
  connect(nod[3].port, roo);
  annotation (Documentation(info="<html>
<p>The nodes stand at equal steps of resistance. The areal capacities are those of linear finite elements with lumped
capacity: each layer's capacity, shared out by the hat function of the node. This is the C twin's wall.</p>
</html>"));
end Wall;
