"""The diagnosis calibrated by a farm: recordings whose cause is known, and what the diagnosis makes of each."""
