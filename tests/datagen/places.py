"""Weather that comes with pvlib, by the name that a description gives it."""

GREENSBORO = "pvlib:723170TYA.CSV"
