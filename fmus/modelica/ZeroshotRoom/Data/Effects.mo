within ZeroshotRoom.Data;
record Effects "What the room leaves out, each with an amplitude that is zero by default"

  record Infiltration "Outdoor air that leaks in"
    parameter Real m0(unit="kg/s") = 0.0 "Constant infiltration";
    parameter Real cWind(unit="kg/m") = 0.0 "Infiltration per wind speed";
    parameter Real cStack(unit="kg/(s.K)") = 0.0 "Infiltration per temperature difference to outdoors";
  end Infiltration;

  record Conductance "A way for heat"
    parameter Real UA(unit="W/K") = 0.0 "Conductance between the room air and the other side";
  end Conductance;

  record Neighbour "An adjacent room"
    parameter Real UA(unit="W/K") = 0.0 "Conductance between the room air and the adjacent room";
    parameter Real T(unit="K", displayUnit="degC") = 293.15 "Temperature of the adjacent room";
  end Neighbour;

  record HeatSource "A source of heat"
    parameter Real Q(unit="W") = 0.0 "Heat flow rate";
  end HeatSource;

  record Share "Something that is missing"
    parameter Real fra(unit="1", max=1) = 0.0 "Share that is missing";
  end Share;

  record Derating "A weak heater"
    parameter Real derate(unit="1", max=1) = 0.0 "Share of the heater's largest power that is missing";
  end Derating;

  record Bypass "Imperfect mixing"
    parameter Real bypass(unit="1", max=1) = 0.0 "Share of the ventilation air that leaves unmixed";
  end Bypass;

  record Opening "A window that opens"
    parameter Real m0(unit="kg/s") = 0.0 "Air exchange at full opening";
    parameter Real cStack(unit="kg/(s.K)") = 0.0 "The same per temperature difference to outdoors";
  end Opening;

  Infiltration infiltration "Infiltration";
  Conductance bridge "Thermal bridge to outdoors";
  Neighbour adjacent "Adjacent room";
  HeatSource plug "Constant plug loads";
  HeatSource timetable "Plug loads that follow yPlu";
  HeatSource valve "Heater power that flows whatever the controller asks for";
  Share shading "Constant shading of the facade";
  Share blinds "Blinds that follow ySha";
  Share shutdown "Ventilation that is off while yOff is 1";
  Derating heater "Heater";
  Bypass mixing "Mixing";
  Opening window "Window that follows yWin";
end Effects;
