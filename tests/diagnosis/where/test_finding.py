"""What a finding says of itself."""

import pytest

from diagnosis.where.finding import Finding


@pytest.mark.parametrize(
    ("kind", "size", "said"),
    [
        ("cell", -1234.0, " by 1230 W, throughout"),
        ("sensor", 1234.0, " ratio +1230)"),
        ("episode", 0.01234, " by 0.0123 W, from"),
    ],
)
def test_amounts_are_told_without_powers_of_ten(kind, size, said):
    cell = {
        "hours": "any",
        "day_type": "any",
        "regime": "any",
        "band": "all",
        "statistic": "mean",
        "period": "from here to there",
    }
    text = Finding(kind, "Q", "heater", cell, 0.01, "measured lower", size, "W", 3.0).text
    assert said in text and "e+" not in text
