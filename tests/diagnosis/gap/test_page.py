"""What the page of a diagnosis says beside the report."""

from types import SimpleNamespace

import numpy as np

from diagnosis.gap.page import answered_by, dated
from tests.diagnosis.gap.report_cases import named, place, report


def test_findings_that_have_a_time_have_a_date():
    zero = np.datetime64("2024-02-28T00:00:00")
    stretch = place("room").model_copy(update={"cell": {"first_s": "86400", "last_s": "216000"}})
    assert dated(stretch, zero) == " (29 Feb 00:00 to 1 Mar 12:00)"
    assert dated(place("room"), zero) == ""


def test_an_answer_is_of_a_sensor_of_a_balance_or_of_both():
    effects = [
        SimpleNamespace(name="offset", changes=["output:room"]),
        SimpleNamespace(name="leak", changes=["parameter"]),
    ]
    search = SimpleNamespace(stages=[SimpleNamespace(lin=SimpleNamespace(effects=effects))])

    def answered(*names):
        ones = [named(name, answer=name in names) for name in ("offset", "leak")]
        return answered_by(SimpleNamespace(search=search, report=report(effects=ones)))

    assert [answered(), answered("offset"), answered("leak"), answered("offset", "leak")] == [
        set(),
        {"sensor"},
        {"balance"},
        {"sensor", "balance"},
    ]
