"""The intervals that answers tell: central ones of 90 %."""

LEVEL = 0.9
HALF_WIDTH = 1.645
"""Half of such an interval's width where the distribution is normal [standard deviations]."""
