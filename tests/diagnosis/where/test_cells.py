import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from diagnosis.where import Regime, Residuals, find_regimes
from diagnosis.where.cells import scan_cells
from tests.diagnosis.where.where_cases import twins, wander, with_observed

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


def weekday_afternoon(residuals):
    return (residuals.hour >= 14) & (residuals.hour < 15) & ~residuals.weekend


def injected(residuals, amount, channel=1):
    observed = residuals.observed.copy()
    observed[channel, weekday_afternoon(residuals)] += amount
    return with_observed(residuals, observed)


@pytest.fixture(scope="module")
def quiet():
    return twins(1, outputs=2, twins=99)


def test_without_a_gap_nothing_is_found(quiet):
    found = scan_cells(quiet)
    assert found.test.p_value > 0.05
    assert found.findings == []


def test_an_offset_at_one_hour_of_weekdays_is_named_with_its_size(quiet):
    found = scan_cells(injected(quiet, 0.8))
    top = found.findings[0]
    assert (top.channel, top.cell["hours"], top.cell["day_type"]) == ("y1", "14:00-15:00", "weekday")
    assert top.cell["regime"] == "any"
    assert top.cell["statistic"] == "mean"
    assert top.direction == "measured higher"
    assert top.size == pytest.approx(0.8, abs=0.15)
    assert top.p_value == pytest.approx(0.01)
    # peeled off, it leaves no echo in the hours beside it or in the scatter of the day
    assert len(found.findings) == 1


def test_an_offset_in_a_regime_is_named(quiet):
    rng = np.random.default_rng(7)
    regimes = [Regime(f"state {k}", "", np.repeat(rng.random(672 // 3) < 0.3, 3)) for k in range(4)]
    observed = quiet.observed.copy()
    observed[0, regimes[2].mask] -= 0.6
    top = scan_cells(with_observed(quiet, observed), regimes).findings[0]
    assert (top.channel, top.cell["regime"], top.cell["hours"]) == ("y0", "state 2", "any")
    assert top.direction == "measured lower"
    assert top.size == pytest.approx(-0.6, abs=0.12)


def test_more_scatter_is_named_by_its_band(quiet):
    observed = quiet.observed.copy()
    noise = np.random.default_rng(8).normal(size=672) * 0.5
    night = quiet.hour < 6
    observed[0, night] += noise[night]
    top = scan_cells(with_observed(quiet, observed)).findings[0]
    assert (top.channel, top.cell["hours"], top.cell["statistic"]) == ("y0", "00:00-06:00", "variance")
    assert top.cell["band"] in ("fast", "hours")
    assert "over periods of" in top.text
    assert top.direction == "more scatter"
    assert top.size > 0


def test_less_scatter_is_no_gap_and_makes_no_offset():
    """A sensor that is far quieter than declared while nobody is there, and 3 ppm off for an hour of each day."""
    rng = np.random.default_rng(0)
    twin = 20 * rng.standard_normal((200, 1, 168))
    plain = Residuals((np.arange(168) + 1) * 3600.0, twin[0], twin, ["CO2"], ["ppm"])
    empty, evening = (plain.hour < 8) | (plain.hour >= 18), (plain.hour > 19) & (plain.hour < 20)
    observed = np.where(empty, 0.2, 20) * rng.standard_normal(168)
    observed[evening] = -3.0
    found = scan_cells(with_observed(plain, observed[None]), [Regime("empty", "n = 0", empty)])
    assert found.test.p_value > 0.05
    assert not [one.text for one in found.findings]
    # a place that is off indeed is named with no more than what is read there
    observed[evening] = -40.0
    found = scan_cells(with_observed(plain, observed[None]), [Regime("empty", "n = 0", empty)])
    assert found.findings[0].size == pytest.approx(-40.0, abs=5.0)
    assert {one.direction for one in found.findings} == {"measured lower"}
    assert all(abs(one.size) < 45.0 for one in found.findings)


def test_missing_readings_are_left_out(quiet):
    observed = injected(quiet, 0.9).observed
    rng = np.random.default_rng(2)
    observed[:, rng.random(672) < 0.15] = np.nan
    observed[:, 200:260] = np.nan
    observed[0] = np.nan
    replicates = quiet.replicates.copy()
    replicates[rng.random(replicates.shape) < 0.02] = np.nan
    gappy = Residuals(quiet.time, observed, replicates, quiet.names, quiet.units)
    found = scan_cells(gappy)
    assert found.channels == [1]
    assert found.findings[0].cell["hours"] == "14:00-15:00"
    assert found.findings[0].size == pytest.approx(0.9, abs=0.2)


def test_means_and_variances_are_those_of_plain_selection(quiet):
    """The vectorised statistics of every cell against NumPy on the selected steps."""
    regime = Regime("state", "", np.random.default_rng(3).random(672) < 0.5)
    observed = quiet.observed.copy()
    observed[:, 50:70] = np.nan
    case = with_observed(quiet, observed)
    found = scan_cells(case, [regime])
    laid = found.test.observed.reshape(found.shape)
    at = {(w.start, w.stop, w.day_type): j for j, w in enumerate(found.windows)}
    pick = (case.hour >= 6) & (case.hour < 12) & case.weekend & regime.mask & np.isfinite(observed[1])
    assert laid[1, 0, 0, 1, at[6, 12, "weekend"]] == pytest.approx(observed[1, pick].mean(), rel=1e-10)
    assert laid[1, 0, 1, 1, at[6, 12, "weekend"]] ** 3 == pytest.approx(observed[1, pick].var(), rel=1e-6)
    twin = case.replicates[:, 1][:, pick].mean(axis=1)
    typical = found.test.typical.reshape(found.shape)[1, 0, 0, 1, at[6, 12, "weekend"]]
    assert typical == pytest.approx(twin.mean(), rel=1e-9)


def test_a_wave_that_is_no_offset_is_named_once_for_each_place(quiet):
    """An afternoon hump: no cell of hours fits it, so each that is taken off leaves something of it behind."""
    observed = quiet.observed.copy()
    hump = np.exp(-(((quiet.hour - 15.0) / 2.5) ** 2))
    observed[0] += 4.0 * hump
    found = scan_cells(with_observed(quiet, observed), most=20)
    places = [(one.channel, one.cell["hours"], one.cell["day_type"], one.cell["regime"]) for one in found.findings]
    assert len(places) == len(set(places)) >= 2
    assert {one.channel for one in found.findings if one.p_value <= 0.01} == {"y0"}
    # the hump is four high, and what is said of it is no more
    assert all(abs(one.size) < 4.5 for one in found.findings if one.cell["statistic"] == "mean")
    first = found.findings[0]
    hours = [int(part[:2]) for part in first.cell["hours"].split("-")]
    assert hours[0] <= 15 <= hours[1]


@pytest.mark.parametrize("seed", range(2))
def test_where_an_offset_of_the_rest_does_not_hold_nothing_is_measured_higher(seed):
    """Half a kelvin low except while it is warm outside, without a course of the day."""
    rng = np.random.default_rng(seed)
    rows = 0.3 * wander(rng, (100, 1, 672), 0.5)
    plain = Residuals((np.arange(672) + 1) * 3600.0, rows[0], rows[1:], ["y"], ["K"])
    outside = wander(rng, (672,), 0.99)
    warm, cold = (
        Regime(label, "", sign * outside > np.quantile(sign * outside, 0.7))
        for label, sign in (("warm outside", 1.0), ("cold outside", -1.0))
    )
    observed = plain.observed - 0.5 * ~warm.mask
    found = scan_cells(with_observed(plain, observed), [warm, cold]).findings
    assert {one.direction for one in found} <= {"measured lower", "measured higher than elsewhere"}
    lower = [one for one in found if one.direction == "measured lower"]
    higher = [one for one in found if one not in lower]
    assert {one.cell["hours"] for one in found} == {"any"}
    assert any(one.cell["regime"] == "any" for one in lower)
    assert all(-0.6 < one.size < -0.25 for one in lower)
    assert higher and all(one.cell["regime"] == "warm outside" for one in higher)
    assert all(0.25 < one.size < 0.6 for one in higher)
    assert "y: measured higher than elsewhere by 0." in higher[0].text


@settings(max_examples=8)
@given(seed=st.integers(0, 100), scales=st.tuples(st.floats(1e-6, 1e3), st.floats(1e-2, 1e6)), swap=st.booleans())
def test_units_and_order_of_channels_do_not_matter(seed, scales, swap):
    plain = injected(twins(seed, steps=336, twins=39), 1.0)
    order = [1, 0] if swap else [0, 1]
    scale = np.array(scales)[:, None]
    other = Residuals(
        plain.time,
        (plain.observed * scale)[order],
        (plain.replicates * scale)[:, order],
        [plain.names[k] for k in order],
        [plain.units[k] for k in order],
    )
    a, b = scan_cells(plain), scan_cells(other)
    np.testing.assert_allclose(
        b.test.adjusted.reshape(b.shape), a.test.adjusted.reshape(a.shape)[order], atol=1.01 / 40
    )
    assert b.test.p_value == pytest.approx(a.test.p_value)
    first, second = a.findings[0], b.findings[0]
    assert (first.channel, first.cell) == (second.channel, second.cell)
    assert second.size == pytest.approx(first.size * scales[plain.names.index(first.channel)], rel=1e-5)


@pytest.mark.slow
def test_false_alarms_are_as_rare_as_promised():
    """400 recordings without a gap, strongly autocorrelated, with missing readings and regimes."""
    rng = np.random.default_rng(10)
    time = (np.arange(120) + 1) * 3600.0
    alarms, named = 0, 0
    for _ in range(400):
        rows = wander(rng, (20, 1, 120))
        rows[0][:, rng.random(120) < 0.05] = np.nan
        regimes = [Regime("one", "", wander(rng, (120,)) > 0), Regime("another", "", wander(rng, (120,)) > 0.3)]
        found = scan_cells(Residuals(time, rows[0], rows[1:], ["a"], ["K"]), regimes)
        alarms += found.test.p_value <= 0.05
        assert not found.findings or found.test.p_value <= 0.05
        named += bool(found.findings)
    assert abs(alarms / 400 - 0.05) < 2.6 * np.sqrt(0.05 * 0.95 / 400)
    assert named >= 0.5 * alarms  # of others nothing that is true can be said
