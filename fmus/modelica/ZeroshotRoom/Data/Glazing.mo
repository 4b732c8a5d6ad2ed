within ZeroshotRoom.Data;
record Glazing "Window; the names are the frame's in the library's glazing record, the meaning is the paper's Table 1"
  parameter Real UFra(unit="W/(m2.K)", min=0.01, max=5.8) = 2.0 "U-value of the window, standard films included";
  parameter Real absSolFra(unit="1", min=0, max=1) = 0.5 "Solar absorptance of the window";
end Glazing;
