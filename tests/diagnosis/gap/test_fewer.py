"""A diagnosis with candidates withheld, from one that was made with them: the same as a fresh one without them."""

import pytest

from diagnosis.gap.diagnosed import diagnose
from tests.diagnosis.conftest import WARM_UP
from tests.diagnosis.gap.gap_cases import candidates, drifting

SPENT = {"simulations", "seconds", "cpu_seconds"}


def alike(found, fresh, where=""):
    """Whether two JSON values are the same but for rounding."""
    if isinstance(fresh, dict):
        assert found.keys() == fresh.keys(), where
        for name in fresh:
            alike(found[name], fresh[name], f"{where}.{name}")
    elif isinstance(fresh, list):
        assert len(found) == len(fresh), where
        for k, (a, b) in enumerate(zip(found, fresh, strict=True)):
            alike(a, b, f"{where}[{k}]")
    elif isinstance(fresh, float):
        assert found == pytest.approx(fresh, rel=1e-7, abs=1e-9), where
    else:
        assert found == fresh, where


@pytest.mark.slow
def test_without_a_candidate_is_what_a_fresh_diagnosis_without_it_says(house, house_recorded, tmp_path):
    """The cause is withheld, for whose sake a second optimum of the base model was looked for."""
    system, path = house("me"), drifting(house_recorded(tmp_path, hours=120, seed=3), by=5.0)
    effects = [one for one in candidates(system) if one.name in ("drift", "gain")]
    done = diagnose(system, path, effects=effects, warm_up=WARM_UP)
    assert "drift" in {one.name for one in done.report.effects if one.named}
    fresh = diagnose(system, path, effects=effects[1:], warm_up=WARM_UP)
    again = done.without(["drift"])
    assert again.report.simulations <= fresh.report.simulations - done.base.simulations  # its fit is known
    alike(again.report.model_dump(exclude=SPENT), fresh.report.model_dump(exclude=SPENT))
    assert "drift" not in {one.name for one in again.report.effects}
