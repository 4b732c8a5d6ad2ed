"""The picture of an import."""

from types import SimpleNamespace

import numpy as np
import pytest

from diagnosis.measurements import output
from diagnosis.measurements.output import draw_recording


@pytest.fixture
def drawn(monkeypatch):
    """``drawn(*origins)``: the figure of a recording of two days, a panel for each origin, with two gaps in each."""
    monkeypatch.setattr(output, "as_png", lambda figure: figure)

    def make(*origins, unit="W", scale=1.0):
        time = 3600.0 * np.arange(1, 49)
        values = np.where((time > 36000) & (time < 50000), np.nan, scale * time)
        signal = SimpleNamespace(middle=time - 1800, flags=np.zeros(48, int), values=values)
        common = {"second": None, "values": values, "flags": np.zeros(48, int), "signal": signal}
        target = SimpleNamespace(name="QHea", unit=unit, method="mean")
        clock = SimpleNamespace(
            offset=0.0, dates=lambda at: np.datetime64("2001-01-01") + (at * 1e3).astype("timedelta64[ms]")
        )
        return draw_recording(
            [SimpleNamespace(origin=one, target=target, **common) for one in origins], time, clock, "toy"
        )

    return make


def test_a_column_s_unit_is_not_that_of_the_axis(drawn):
    one, other = drawn("heater_kW [kW]", "computed from sun").axes
    assert (one.get_title(loc="left"), one.get_ylabel()) == ("from heater_kW (kW)", "QHea\n[W]")
    assert other.get_title(loc="left") == "computed from sun"
