"""What is taken where nothing is said, by commands and by the functions behind them."""

WARM_UP = 240.0
"""A recording's first day is repeated so long before its start [h]."""
STARTS = 3
"""Of a calibration."""

LEVEL = 0.9
"""Of the intervals that answers tell: central ones."""
HALF_WIDTH = 1.645
"""Half of such an interval's width where the distribution is normal [standard deviations]."""
