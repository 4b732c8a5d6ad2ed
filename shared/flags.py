"""What the quality flags of a recording's variables mean, which an import writes beside them."""

from __future__ import annotations

FLAGS = {
    "missing": 1,
    "partly_covered": 2,
    "impossible_readings_left_out": 4,
    "stuck_readings_left_out": 8,
    "gap_interpolated": 16,
    "assumed": 32,
    "computed_from_other_quantities": 64,
}
"""Bits of the flag variables of a recording, in CF's ``flag_meanings``."""
MISSING, PARTLY, IMPOSSIBLE, STUCK, INTERPOLATED, ASSUMED, COMPUTED = FLAGS.values()
