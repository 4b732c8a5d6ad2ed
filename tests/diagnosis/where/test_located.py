import io
import tracemalloc
from dataclasses import replace

import matplotlib.image
import numpy as np
import pytest

from diagnosis.curves import as_png
from diagnosis.where import Regime, Residuals, locate
from diagnosis.where.correlation import scan_correlations
from diagnosis.where.episodes import _refined, scan_episodes
from diagnosis.where.pictures import draw_cells, draw_correlations, draw_episodes, few_digits, source_panels
from tests.diagnosis.where.where_cases import first_order, heat, twins, wander, with_observed

STEPS, PER = 336, 4


@pytest.fixture(scope="module")
def quiet():
    return twins(5, outputs=2, steps=STEPS, twins=59)


@pytest.fixture(scope="module")
def inputs(quiet):
    rng = np.random.default_rng(11)
    sun = np.clip(np.sin((quiet.hour - 6) / 12 * np.pi), 0, None) * (1 + 0.4 * wander(rng, (STEPS,), 0.8))
    return {"sun": 500 * sun, "wind": np.abs(wander(rng, (STEPS,), 0.9)), "constant": np.full(STEPS, 420.0)}


def test_nothing_is_found_where_nothing_is(quiet, inputs):
    assert scan_correlations(quiet, inputs).findings == []
    assert scan_episodes(quiet).findings == []
    assert scan_correlations(quiet, {"constant": inputs["constant"]}) is None


def test_bands_hold_95_percent_of_the_twins_at_each_lag_and_at_all_of_them_together():
    """What a twin's correlation is, the scan says of it as the recording, and of the recording as its twin."""
    calm = twins(9, outputs=1, steps=168, twins=39)
    wind = {"wind": wander(np.random.default_rng(2), (168,), 0.9)}
    found = scan_correlations(calm, wind)
    own = []
    for b in range(39):
        others = calm.replicates.copy()
        others[b] = calm.observed
        own.append(scan_correlations(replace(calm, observed=calm.replicates[b], replicates=others), wind).correlation)
    own = np.array(own)
    np.testing.assert_allclose(found.low, np.quantile(own, 0.025, axis=0), atol=1e-9)
    np.testing.assert_allclose(found.high, np.quantile(own, 0.975, axis=0), atol=1e-9)
    # together, in Fisher's z: as many standard deviations about the twins' mean as the second largest of 39 twins
    # reaches, each beside all other recordings
    z = np.arctanh(np.concatenate([found.correlation[None], own]))
    reached = []
    for b in range(1, 40):
        others = np.delete(z, b, axis=0)
        reached.append(np.max(np.abs(z[b] - others.mean(axis=0)) / others.std(axis=0, ddof=1)))
    half = sorted(reached)[-2] * z[1:].std(axis=0, ddof=1)
    np.testing.assert_allclose(found.simultaneous_low, np.tanh(z[1:].mean(axis=0) - half), atol=1e-9)
    np.testing.assert_allclose(found.simultaneous_high, np.tanh(z[1:].mean(axis=0) + half), atol=1e-9)


def test_the_input_that_the_residual_follows_is_named_with_its_lag(quiet, inputs):
    observed = quiet.observed.copy()
    observed[0, 5:] -= 0.4 * inputs["wind"][:-5]
    found = scan_correlations(with_observed(quiet, observed), inputs)
    assert found.inputs == ["sun", "wind"]
    assert [(f.channel, f.cell["input"], f.cell["lag_hours"]) for f in found.findings] == [("y0", "wind", "5")]
    assert found.findings[0].direction == "measured lower"
    # prewhitened alike, the correlation is that of NumPy on the innovations
    lag = int(np.argmin(found.correlation[0, 1]))
    assert found.lags[lag] == 5 * 3600


def test_inputs_that_merely_follow_the_cause_are_not_named(quiet, inputs):
    observed = quiet.observed.copy()
    observed[1] += 0.004 * inputs["sun"]
    followers = {**inputs, "warmth": np.convolve(inputs["sun"], np.exp(-np.arange(20) / 3), "full")[:STEPS]}
    found = scan_correlations(with_observed(quiet, observed), followers)
    assert [(f.channel, f.cell["input"], f.cell["lag_hours"]) for f in found.findings] == [("y1", "sun", "0")]


@pytest.mark.parametrize(("lag", "said"), [(3, "30 min after"), (33, "5.5 h after")])
def test_a_lag_between_full_hours_is_found_as_often_as_none(lag, said):
    """At steps of ten minutes, in noise whose innovations are small beside it."""
    found = []
    for seed in range(6):
        calm = twins(seed, outputs=1, steps=720, twins=39, step=600.0)
        rng = np.random.default_rng(100 + seed)
        wind = wander(rng, (720,), 0.9)
        observed = calm.observed.copy()
        observed[0, lag:] += 0.15 * wind[: 720 - lag]
        scanned = scan_correlations(with_observed(calm, observed), {"wind": wind, "sun": wander(rng, (720,), 0.95)})
        found += [(one.cell["input"], one.cell["lag"]) for one in scanned.findings]
    assert found.count(("wind", said)) >= 5
    assert len(found) <= 7


@pytest.mark.slow
def test_correlations_at_short_steps_raise_false_alarms_as_rarely_as_promised():
    alarms = 0
    for seed in range(200):
        calm = twins(seed, outputs=1, steps=288, twins=19, step=600.0)
        rng = np.random.default_rng(1000 + seed)
        alarms += scan_correlations(calm, {"wind": wander(rng, (288,), 0.9)}).test.p_value <= 0.05
    assert abs(alarms / 200 - 0.05) < 2.6 * np.sqrt(0.05 * 0.95 / 200)


def test_an_episode_is_found_with_its_ends(quiet):
    observed = quiet.observed.copy()
    observed[0, 100:150] += 5.0
    found = scan_episodes(with_observed(quiet, observed))
    assert [f.channel for f in found.findings] == ["y0"]
    assert found.findings[0].size == pytest.approx(5.0, abs=1.5)
    first, last = found.spans[0]
    assert first / 3600 == pytest.approx(100, abs=2)
    assert last / 3600 == pytest.approx(150, abs=2)


def test_a_stretch_is_said_to_differ_from_the_rest_by_what_it_does():
    """What calibration bent to a lasting episode: low within it, and high outside."""
    rows = 0.1 * wander(np.random.default_rng(6), (60, 1, STEPS), 0.5)
    calm = Residuals(3600.0 * np.arange(1, STEPS + 1), rows[0], rows[1:], ["y"], ["K"])
    inside = (np.arange(STEPS) >= 96) & (np.arange(STEPS) < 240)
    observed = calm.observed + np.where(inside, -0.242, 0.201)
    found = scan_episodes(with_observed(calm, observed))
    first = found.findings[0]
    assert first.size == pytest.approx(observed[0, inside].mean() - observed[0, ~inside].mean(), abs=0.02)
    assert first.text.startswith("y: measured lower than in the rest of the recording by 0.4")
    (axes,) = draw_episodes(with_observed(calm, observed), found).axes
    assert axes.texts[0].get_text().startswith("lower than the rest by 0.4")


def test_a_stretch_beside_one_that_was_named_is_not_higher_than_a_rest_that_is_not():
    """Five high for four days, then one for two: lower than a rest with the former, higher than one without."""
    rows = 0.1 * wander(np.random.default_rng(7), (60, 1, STEPS), 0.5)
    calm = Residuals(3600.0 * np.arange(1, STEPS + 1), rows[0], rows[1:], ["y"], ["K"])
    observed = calm.observed.copy()
    observed[0, 48:144] += 5.0
    observed[0, 216:264] += 1.0
    found = scan_episodes(with_observed(calm, observed)).findings
    assert [one.direction.split()[1] for one in found[:2]] == ["higher", "higher"]
    assert [round(one.size) for one in found[:2]] == [5, 1]


def test_a_change_of_scatter_is_found_where_it_begins(quiet):
    observed = quiet.observed.copy()
    observed[1, 200:] += 2.5 * np.random.default_rng(1).normal(size=STEPS - 200)
    found = scan_episodes(with_observed(quiet, observed))
    top = found.findings[0]
    assert (top.channel, top.direction, top.cell["statistic"]) == (
        "y1",
        "more scatter than in the rest of the recording",
        "variance",
    )
    assert found.spans[0][0] / 3600 == pytest.approx(200, abs=24)
    assert top.cell["period"].endswith("on")


@pytest.fixture(scope="module")
def everything(quiet, inputs):
    plant = heat(
        first_order(STEPS, 12, 1 / 300, outputs=2, output=0, per=PER)
        + first_order(STEPS, 12, -1 / 400, outputs=2, output=1, per=PER)
    )
    gains = 0.6 * inputs["sun"].reshape(-1, PER).mean(axis=1)
    observed = quiet.observed + plant.response @ gains
    observed[:, 40:60] = np.nan
    regimes = [Regime("sun out", "sun > 100 W/m2", inputs["sun"] > 100)]
    return locate(with_observed(quiet, observed), inputs=inputs, regimes=regimes, operators=[plant])


def test_one_p_value_covers_all_families(everything):
    assert everything.p_value == pytest.approx(1 / 60)
    assert everything.families == ["cells", "correlations", "episodes", "sources"]
    assert all(f.p_value <= 0.05 for f in everything.findings)
    kinds = {f.kind for f in everything.findings}
    assert {"cell", "correlation", "source"} <= kinds
    assert everything.verdict == "balance"
    first = everything.findings[0]
    assert {"hours", "day_type", "regime", "band"} <= set(first.cell)
    assert "p = " in first.text
    assert {(one.label, one.rule) for one in everything.cells.regimes} >= {("sun out", "sun > 100 W/m2")}


def test_a_channel_that_was_hardly_read_is_drawn(quiet, inputs):
    """Whitening needs the first steps; what is left of two readings has no correlation with anything."""
    seen = np.stack([np.isin(np.arange(STEPS), [0, 2]), np.full(STEPS, True)])
    series = (np.where(seen, one, np.nan) for one in (quiet.observed, quiet.replicates))
    residuals = replace(quiet, **dict(zip(("observed", "replicates"), series, strict=True)))
    found = locate(residuals, inputs=inputs)
    for figure in (draw_cells(residuals, found.cells), draw_correlations(residuals, found.correlations)):
        assert figure.axes


@pytest.mark.parametrize(
    ("family", "draw", "panels"),
    [("cells", draw_cells, 2), ("correlations", draw_correlations, 4), ("episodes", draw_episodes, 2)],
)
def test_pictures_are_drawn(everything, family, draw, panels):
    figure = draw(everything.residuals, getattr(everything, family))
    assert matplotlib.image.imread(io.BytesIO(as_png(figure, 60))).std() > 0.05
    assert len([a for a in figure.axes if a.get_title(loc="left") or a.get_title() or family == "episodes"]) >= panels


def test_missing_sources_are_drawn_in_a_unit_of_few_digits_with_what_effects_account_for(everything):
    found = everything.sources
    explained = {one.name: 0.5 * one.estimate for one in found.sources}
    made = source_panels(everything.residuals, found, np.datetime64("2001-01-01"), explained=explained)
    for panel, one in zip(made, found.sources, strict=True):
        drawn = {curve.label: curve.values for curve in panel.curves}
        factor, unit = few_digits(one.unit, float(max(np.abs(one.estimate).max(), np.abs(one.high).max())))
        assert (panel.title, panel.unit) == (one.label, unit)
        np.testing.assert_allclose(drawn["what the base model lacks"], factor * one.estimate)
        np.testing.assert_allclose(drawn["what the effects found account for"], 0.5 * factor * one.estimate)
    (weekends,) = made[0].strips
    assert {int(day) for day in (weekends.begins.astype("datetime64[D]").astype(int) + 3) % 7} <= {5, 6}


def test_pictures_mark_what_the_list_names_and_nothing_else(everything):
    """A place that stands out in its own family may not do so among all that was looked at."""
    cells = everything.cells.test
    beyond = replace(cells, maxima=cells.maxima + np.where(np.arange(len(cells.maxima)) > 0, 1e9, 0.0))
    never = replace(everything, cells=replace(everything.cells, test=beyond))
    for family in ("cells", "correlations", "episodes"):
        own, test = getattr(everything, family).test, getattr(everything.among_all(), family).test
        assert (test.adjusted >= own.adjusted).all()
        marked = np.abs(test.t[test.adjusted <= 0.05])
        assert (everything._p_of_all(family, marked) <= 0.05).all()
        assert never.findings == [] and (getattr(never.among_all(), family).test.adjusted > 0.05).all()
    assert (everything.among_all().cells.test.adjusted <= 0.05).any()
    ones = everything.episodes.findings
    odd = [replace(everything.episodes, findings=[replace(one, p_value=p) for one in ones]) for p in (1.0, 0.0)]
    drawn = [draw_episodes(everything.residuals, one).axes for one in odd]
    said = [sum(len(axes.texts) for axes in panels) for panels in drawn]
    assert said == [0, len(ones)]


def test_the_heat_map_shows_the_offsets_in_the_channel_s_unit(everything):
    figure = draw_cells(everything.residuals, everything.cells)
    image = figure.axes[0].get_images()[0].get_array()
    hours = everything.residuals.hour
    seen = np.isfinite(everything.residuals.observed[0])
    pick = (hours >= 15) & (hours < 16) & seen
    typical = everything.residuals.replicates[:, 0][:, pick].mean()
    assert image[0, 15] == pytest.approx(everything.residuals.observed[0, pick].mean() - typical, rel=1e-9)


def test_no_sensor_is_suspected_where_no_place_stands_out(quiet, inputs):
    """A source that is odd among sources alone, in a recording of which nothing is said: the picture accuses nobody."""
    found = locate(
        quiet,
        inputs=inputs,
        operators=[heat(first_order(STEPS, 12, 1 / 300, outputs=2, output=0, per=PER))],
    )
    assert (found.verdict, found.findings) == ("none", [])
    one = replace(found.sources.sources[0], p_value=0.04, verdict="sensor", rival="y0", gain=9.0)
    for verdict in ("sensor", "balance", "undecided"):
        odd = replace(found.sources, sources=[replace(one, verdict=verdict)], suspect="y0")
        said = "explains more than in replicates without a gap, but not once all places are tested together"
        assert odd.words(odd.sources[0], "the thermometer") == said
        assert said in odd.said({"y0": "the thermometer"})[0]


def test_the_ends_of_a_long_stretch_are_found_in_little_memory():
    """Four weeks of minutes, of which eight days are higher: within a four-hundredth of them, as with every minute."""
    steps, first, last = 40_320, 14_000, 25_520
    values = 0.5 * np.random.default_rng(1).standard_normal(steps)
    values[first:last] += 1.0
    tracemalloc.start()
    start, stop = _refined(values, first - 3000, last + 2000, "mean")
    peak = tracemalloc.get_traced_memory()[1]
    tracemalloc.stop()
    assert peak < 200e6
    assert abs(start - first) <= 50 and abs(stop - last) <= 50


def test_a_strong_gap_makes_nothing_beside_it_surer():
    """What is found among all places is no surer than among those of its own kind, against twins that have no gap."""
    case = twins(1, outputs=2, steps=STEPS, twins=199, phi=0.7)
    wind = wander(np.random.default_rng(1001), (STEPS,), 0.9)
    observed = case.observed.copy()
    observed[0] += 8 * wind
    observed[0, 100:150] += 8
    found = locate(with_observed(case, observed), inputs={"wind": wind})
    own = [*found.cells.findings, *found.episodes.findings, *found.correlations.findings]
    assert len(found.findings) > 3
    for one in found.findings:
        assert one.p_value >= next(same for same in own if replace(same, p_value=one.p_value) == one).p_value
    # the same, worked out from the twins alone
    tests = [found.cells.test, found.correlations.test, found.episodes.test]
    twin = np.stack([one.maxima[1:] for one in tests], axis=1)
    reach = ((twin - twin.mean(axis=0)) / twin.std(axis=0, ddof=1)).max(axis=1)
    level = (1 + 1e-6) * found.correlations.test.level  # the level itself is a twin's, equal but for rounding
    size = (level - twin[:, 1].mean()) / twin[:, 1].std(ddof=1)
    expected = (1 + (reach >= size).sum()) / 200
    assert found._p_of_all("correlations", level) == pytest.approx(expected)


@pytest.mark.parametrize(("share", "stands_out"), [(0.5, False), (1.0, False), (1.5, True)])
def test_only_a_recording_noisier_than_its_twins_stands_out_by_noise(share, stands_out):
    rng = np.random.default_rng(3)
    case = twins(1, outputs=1, steps=STEPS, twins=199, phi=0.0)
    observed = share * rng.standard_normal((1, STEPS))
    found = locate(with_observed(case, observed), inputs={})
    assert (found.p_value <= 0.01) is stands_out
    assert any("more scatter" in one.text for one in found.findings) is stands_out


def test_a_stretch_that_is_quieter_than_the_rest_is_no_episode():
    case = twins(2, outputs=1, steps=STEPS, twins=199, phi=0.0)
    observed = case.observed.copy()
    observed[0, 96:192] *= 0.2
    quiet = scan_episodes(with_observed(case, observed))
    assert quiet.test.p_value > 0.05
    observed[0, 96:192] *= 15.0
    found = scan_episodes(with_observed(case, observed)).findings
    (noisy,) = (one for one in found if one.cell["statistic"] == "variance")
    assert noisy.direction == "more scatter than in the rest of the recording"
    assert noisy.size == pytest.approx(2.0, abs=0.5)
