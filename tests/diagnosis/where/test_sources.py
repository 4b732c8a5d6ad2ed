from dataclasses import replace

import numpy as np
import pytest
from scipy.stats import multivariate_normal

from diagnosis.where.series import fit_colour, whiten, whitened
from diagnosis.where.sources import FAINT, MEMORIES, OTHERWISE, _findings, decompose, scan_sources
from tests.diagnosis.where.where_cases import first_order, heat, twins, wander, with_observed

STEPS, PER = 336, 2


@pytest.fixture(scope="module")
def quiet():
    return twins(3, outputs=2, steps=STEPS, twins=59)


@pytest.fixture(scope="module")
def plant():
    """A source warms output 0 (time constant 12 h) and lowers output 1, as a controller answers it."""
    return heat(
        first_order(STEPS, 12, 1 / 300, outputs=2, output=0, per=PER)
        + first_order(STEPS, 12, -1 / 400, outputs=2, output=1, per=PER)
    )


def test_an_autoregression_is_fitted_and_taken_out():
    rng = np.random.default_rng(0)
    series = wander(rng, (60, 700), 0.9)
    series[rng.random(series.shape) < 0.1] = np.nan
    colour = fit_colour(series, 2)
    assert colour == pytest.approx([0.9, 0.0], abs=0.03)
    white = whiten(wander(rng, (60, 700), 0.9), np.array([0.9]))
    assert np.isnan(white[:, 0]).all()
    assert white[:, 1:].std() == pytest.approx(np.sqrt(1 - 0.81), rel=0.02)


def test_the_inverse_is_the_ridge_solution_and_its_gain_the_gaussian_evidence():
    """Against the normal equations and scipy's multivariate normal, written out densely."""
    rng = np.random.default_rng(1)
    response, rows = rng.normal(size=(30, 8)), rng.normal(size=(3, 30)) * 3
    centres = np.arange(8) * 3600.0
    covariance = np.exp(-np.abs(centres[:, None] - centres) / 7200.0)
    problem = decompose(rows, response, centres, 7200.0)
    tau = 0.7
    precision = response.T @ response + np.linalg.inv(tau * covariance)
    np.testing.assert_allclose(problem.solve(tau), np.linalg.solve(precision, response.T @ rows.T).T, rtol=1e-6)
    np.testing.assert_allclose(problem.uncertainty(tau), np.sqrt(np.diag(np.linalg.inv(precision))), rtol=1e-6)
    gains, taus = problem.gains()
    for row, gain, best in zip(rows, gains, taus, strict=True):
        dense = np.eye(30) + best * response @ covariance @ response.T
        expected = multivariate_normal(np.zeros(30), dense).logpdf(row) - multivariate_normal(np.zeros(30)).logpdf(row)
        assert gain == pytest.approx(expected, abs=1e-5)
    share = problem.tau_for(0.3) * problem.strength
    assert (share / (1 + share)).sum() == pytest.approx(0.3 * 8, rel=1e-6)


def test_without_a_gap_no_source_is_missing(quiet, plant):
    found = scan_sources(quiet, [plant])
    assert found.test.p_value > 0.05
    assert found.verdict == "none"
    assert found.findings == []


def test_a_missing_source_is_found_with_its_course(quiet, plant):
    truth = np.where((np.arange(STEPS // PER) * PER % 24 >= 9) & (np.arange(STEPS // PER) * PER % 24 < 17), 250.0, 0.0)
    found = scan_sources(with_observed(quiet, quiet.observed + plant.response @ truth), [plant])
    one = found.sources[0]
    assert found.verdict == "balance"
    assert one.p_value == pytest.approx(1 / 60)
    assert np.corrcoef(one.estimate, truth)[0, 1] > 0.9
    assert one.estimate[truth > 0].mean() == pytest.approx(250, rel=0.2)
    assert np.mean(np.abs(one.estimate - truth) < 2 * one.uncertainty) > 0.8
    # what explains half of the residual accounts for half of what is missing
    half = found.courses(0.5 * (quiet.observed + plant.response @ truth))[one.name]
    assert half == pytest.approx(0.5 * one.estimate, abs=1e-6 * np.abs(one.estimate).max())
    assert found.findings[0].direction == "the model lacks a gain"
    assert found.findings[0].unit == "W"


def test_the_band_of_a_source_holds_95_percent_of_the_twins(quiet, plant):
    """Of what the twins have for a source under the recording's own prior."""
    case = with_observed(quiet, quiet.observed + plant.response @ np.full(STEPS // PER, 250.0))
    (one,) = scan_sources(case, [plant]).sources
    white = whitened(case)
    centres = (plant.edges[1:] + plant.edges[:-1]) / 2
    solved = []
    for memory in MEMORIES:
        problem = decompose(white.rows, white.response(plant.response), centres, memory)
        solved.append(problem.solve(problem.gains()[1][0]))
    (rows,) = [each for each in solved if np.allclose(each[0], one.estimate)]
    np.testing.assert_allclose(one.low, np.quantile(rows[1:], 0.025, axis=0))
    np.testing.assert_allclose(one.high, np.quantile(rows[1:], 0.975, axis=0))


def test_a_sensor_fault_is_told_from_a_balance(quiet, plant):
    """A sensor that reads a day of steps off: to imitate it the source would have to pulse both ways."""
    observed = quiet.observed.copy()
    observed[0, 100:124] += 1.5
    observed[0, 200:230] -= 1.5
    found = scan_sources(with_observed(quiet, observed), [plant])
    assert found.verdict == "sensor"
    assert found.sources[0].rival == "y0"
    assert found.sources[0].balance < -3
    assert [f.kind for f in found.findings] == ["sensor"]
    assert found.words(found.sources[0], "the thermometer").endswith("suspect that sensor")
    for answered, said in (({"sensor"}, "suspect that sensor"), ({"balance"}, OTHERWISE), ({"none"}, FAINT)):
        assert found.words(found.sources[0], "the thermometer", answered=answered).endswith(f": {said}")
        assert said in found.said({"y0": "the thermometer"}, answered)[0]


def test_no_sensor_is_suspected_where_another_source_explains_what_its_error_would(quiet):
    """Missing heat; a gas, of which none is missing, moves the same output a little."""
    warm = heat(first_order(STEPS, 12, 1 / 300, outputs=2, output=0, per=PER))
    gas = replace(heat(0.1 * warm.response + warm.response[::-1]), name="gas", label="missing gas")
    observed = quiet.observed + warm.response @ (200 * wander(np.random.default_rng(5), (STEPS // PER,), 0.95))
    found = scan_sources(with_observed(quiet, observed), [warm, gas])
    one, other = found.sources
    assert (found.verdict, one.verdict) == ("balance", "balance")
    assert other.p_value > 0.05 and (other.verdict, other.rival) == ("sensor", "y0")
    assert found.words(one, "the thermometer").endswith("than an error of the thermometer alone: this balance is off")
    assert found.words(one, "the thermometer", answered={"sensor"}).endswith(f"alone: {OTHERWISE}")
    assert found.words(other, "the thermometer") == (
        "explains no more than in replicates without a gap: none of it is needed"
    )
    (said,) = [one.direction for one in found.findings if one.kind == "sensor"]
    assert said == (
        "an error of this channel alone explains the residual better than missing gas, of which none is needed,"
        " but worse than missing heat"
    )
    assert "suspect" not in found.said({"y0": "the thermometer"})[1]


@pytest.mark.parametrize("turned", [False, True])
def test_what_explains_a_residual_does_not_depend_on_the_order_of_sources(quiet, turned):
    """One output that two sources move: what one of them explains, its sensor's error explains about as well."""
    found = scan_sources(quiet, [heat(first_order(STEPS, 12, 1 / 300, outputs=2, output=0, per=PER))])
    far = replace(found.sources[0], name="far", label="missing heat", gain=0.3, balance=-19.7, p_value=0.9)
    far = replace(far, verdict="sensor", rival="y0")
    near = replace(far, name="near", label="missing CO2", gain=19.0, balance=-1.0, p_value=0.01, verdict="undecided")
    sources = [near, far] if turned else [far, near]
    test = replace(found.test, adjusted=np.full(3, 0.01), t=np.full(3, 4.0))
    done = replace(found, sources=sources, sensor_gains={"y0": 20.0}, suspect="y0", test=test)
    assert done.verdict == "undecided"
    (said,) = [one.direction for one in _findings(quiet, done, [0]) if one.kind == "sensor"]
    assert said == "an error of this channel alone explains the residual about as well as missing CO2"


def test_missing_readings_do_not_look_like_a_source(quiet, plant):
    truth = np.zeros(STEPS // PER)
    truth[60:80] = 400.0
    observed = quiet.observed + plant.response @ truth
    observed[:, np.random.default_rng(1).random(STEPS) < 0.1] = np.nan
    observed[1, 20:60] = np.nan
    found = scan_sources(with_observed(quiet, observed), [plant])
    assert found.verdict == "balance"
    assert found.sources[0].estimate[62:78].mean() == pytest.approx(400, rel=0.25)


def test_only_a_sensor_that_the_source_itself_moves_is_suspected_in_its_stead(quiet):
    """Parameters that make up for a source move the other output too, whose own error is far larger."""
    alone = heat(first_order(STEPS, 12, 1 / 300, outputs=2, output=0, per=PER))

    def left(response):
        return np.stack([0.5 * response[0], response[1] + 0.5 * response[0]])

    observed = quiet.observed + np.einsum("kts,s->kt", left(alone.response), np.full(STEPS // PER, 200.0))
    observed[1, 100:124] += 9.0
    found = scan_sources(with_observed(quiet, observed), [alone], left=left)
    assert found.sensor_gains["y1"] > found.sensor_gains["y0"]
    assert found.sources[0].rival == "y0"
    assert np.median(found.sources[0].estimate) == pytest.approx(200, rel=0.15)


def test_what_parameters_make_of_a_sensors_error_is_no_missing_source(quiet):
    """The second output's sensor errs; parameters that make up for a part of it bend the first as a source would."""
    alone = heat(first_order(STEPS, 12, 1 / 300, outputs=2, output=0, per=PER))
    error = 12.0 * np.sin(np.arange(STEPS) / 12)
    bent = alone.response @ (150.0 * np.sin(np.arange(STEPS // PER) * PER / 12))
    observed = quiet.observed + bent + np.stack([np.zeros(STEPS), error])
    found = scan_sources(with_observed(quiet, observed), [alone])
    assert found.sources[0].verdict == "balance"
    assert found.suspect == "y1"
    assert found.verdict == "sensor"
    assert found.words(found.sources[0], "y0") == "explains the residual better than an error of y0 alone"
    assert ("sensor", "y1") in [(one.kind, one.channel) for one in found.findings]


@pytest.mark.slow
def test_source_and_sensor_are_told_apart_nine_times_in_ten(plant):
    """Twenty recordings each of a random smooth source and of a sensor with as smooth an error."""
    right = []
    for seed in range(20):
        case = twins(100 + seed, outputs=2, steps=STEPS, twins=39)
        rng = np.random.default_rng(seed)
        source = 300 * wander(rng, (STEPS // PER,), np.exp(-PER / 24))
        right.append(
            scan_sources(with_observed(case, case.observed + plant.response @ source), [plant]).verdict == "balance"
        )
        error = np.zeros((2, STEPS))
        error[seed % 2] = 1.5 * np.repeat(rng.normal(size=STEPS // 12), 12)
        right.append(scan_sources(with_observed(case, case.observed + error), [plant]).verdict == "sensor")
    assert np.mean(right) >= 0.9
