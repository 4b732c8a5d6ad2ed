"""Signs in numbers that are of thousands, of decimals, or of either."""

from pathlib import Path

import numpy as np
import pandas as pd
import pytest

from diagnosis.measurements.table import Measurements
from shared.errors import RecordingError


def read(texts, decimal):
    data = Measurements(
        Path("log.csv"), np.arange(float(len(texts))), "UTC", pd.DataFrame({"heat": texts}), decimal, {""}
    )
    return data.numbers("heat", "here"), data.notes


@pytest.mark.parametrize(
    ("texts", "decimal", "numbers"),
    [
        (["1.523,5", "12", "0,25", "-1.234.567"], ",", [1523.5, 12.0, 0.25, -1234567.0]),
        (["985", "1.020", "", "12.400"], ",", [985.0, 1020.0, np.nan, 12400.0]),
        (["21.5", "3.4", "0.125"], ",", [21.5, 3.4, 0.125]),
        (["985.25", "1020.5", "1e3"], ".", [985.25, 1020.5, 1000.0]),
    ],
)
def test_what_can_only_be_one_thing_is_read_as_it(texts, decimal, numbers):
    found, notes = read(texts, decimal)
    np.testing.assert_array_equal(found, numbers)
    assert bool(notes) == any("of thousands" in note for note in notes)
    assert bool(notes) == (decimal == "," and np.nanmax(np.abs(found)) > 1000)


@pytest.mark.parametrize(
    ("texts", "decimal"),
    [
        (["1.532", "2.140", "1.875"], ","),
        (["985", "1,020", "930"], ","),
    ],
)
def test_what_can_be_either_is_refused(texts, decimal):
    with pytest.raises(RecordingError, match="may be of thousands or of decimals"):
        read(texts, decimal)
