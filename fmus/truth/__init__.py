"""The truth of the blind check: the default FMU with finer walls and with what no candidate effect has."""
