import numpy as np
import pytest

from diagnosis.where import find_regimes

STEPS = 480


@pytest.fixture
def series(default_system):
    hour = np.arange(STEPS) % 24
    rng = np.random.default_rng(0)
    inputs = {
        "TDryBul": 280 + 5 * np.sin(np.arange(STEPS) / 40),
        "winSpe": rng.gamma(2.0, size=STEPS),
        "HFac": 500 * np.clip(np.sin((hour - 6) / 12 * np.pi), 0, None),
        "CO2Out": np.full(STEPS, 420.0),
        "nPer": np.where((hour >= 9) & (hour < 17), 5.0, 0.0),
        "TSet": np.where(hour < 6, 290.0, 294.0),
        "excHea": rng.normal(size=STEPS),
    }
    simulated = np.stack(
        [
            294 + rng.normal(size=STEPS),
            600 + 100 * rng.normal(size=STEPS),
            np.clip(2000 + 3000 * rng.normal(size=STEPS), 0, 4000),
            np.maximum(0.1, 0.1 + 0.1 * rng.normal(size=STEPS)),
        ]
    )
    return inputs, simulated


def test_states_follow_from_sources_and_bounds(default_system, series):
    inputs, simulated = series
    found = {r.label: r for r in find_regimes(default_system, inputs, simulated)}
    np.testing.assert_array_equal(found["occupied"].mask, inputs["nPer"] > 0)
    np.testing.assert_array_equal(found["empty"].mask, inputs["nPer"] == 0)
    assert found["sun on HFac"].mask[inputs["HFac"] == 0].sum() == 0
    assert found["sun on HFac"].mask[inputs["HFac"] > 250].all()
    (windy,) = (one for label, one in found.items() if label.startswith("wind above "))
    assert windy.mask.mean() == pytest.approx(0.25, abs=0.01)
    for q, word, sign in ((0.25, "below", -1.0), (0.75, "above", 1.0)):  # a quarter, whatever the climate
        there = found[f"{word} {np.quantile(inputs['TDryBul'], q) - 273.15:.1f} degC outside"].mask
        assert there.mean() == pytest.approx(0.25, abs=0.01)
        assert (sign * inputs["TDryBul"])[there].min() > (sign * inputs["TDryBul"])[~there].max()
    np.testing.assert_array_equal(found["TSet in its upper half"].mask, inputs["TSet"] > 292)
    np.testing.assert_array_equal(found["heater power at its maximum"].mask, simulated[2] > 3993)
    np.testing.assert_array_equal(found["heater power above its minimum"].mask, simulated[2] > 6)
    assert "outdoor air mass flow rate above its minimum" in found
    assert found["room air temperature high"].mask.mean() == pytest.approx(0.25, abs=0.01)
    assert not any("excHea" in r.rule or "CO2Out" in r.rule for r in found.values())
    assert found["occupied"].rule == "nPer > 0"


def test_a_state_that_always_or_never_holds_says_nothing(default_system, series):
    inputs, simulated = series
    inputs = {**inputs, "nPer": np.ones(STEPS) + (np.arange(STEPS) == 0)}
    labels = [r.label for r in find_regimes(default_system, inputs, simulated)]
    assert "occupied" not in labels
    assert "empty" not in labels
