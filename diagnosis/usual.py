"""What is taken where nothing is said, by commands and by the functions behind them."""

WARM_UP = 240.0
"""A recording's first day is repeated so long before its start [h]."""
STARTS = 3
"""Of a calibration."""
