"""The ceiling against Bayesian linear regression done the long way, and against what must hold of any limit."""

from dataclasses import replace

import numpy as np
import pytest

import datagen.limits.sensitivities as sensitivities
from datagen.cli import app
from datagen.limits.ceilings import ceilings_of, identifiability, posterior_variance
from datagen.limits.sensitivities import Window, random_window
from shared.ceiling import Ceilings, read_ceilings
from shared.errors import SimulationError, SystemDescriptionError
from tests.datagen.faults import faulty


def limits(found):
    return np.array(list(found.r2.values()))


def made_up_window(system, rng, steps=12, states=3, constants=2, pulses=5):
    outputs = len(system.outputs)
    root = rng.normal(size=(pulses, pulses))
    return Window(
        parameters=rng.normal(size=(outputs, steps, len(system.parameters))),
        states=rng.normal(size=(outputs, steps, states)),
        constants=rng.normal(size=(outputs, steps, constants)),
        occupancy=rng.normal(size=(outputs, steps, pulses)),
        occupancy_covariance=root @ root.T,
        occupancy_steps=np.array([2, 2, 2, 7, 8])[:pulses],
        visited=rng.normal(size=(steps, states)),
    )


@pytest.mark.parametrize("counted", [False, True])
def test_posterior_equals_conditioning_the_joint_gaussian(default_system, counted):
    """Build the joint covariance of all unknowns and data, and condition: no Woodbury, no information form.

    Persons who were counted are data: the means of three pulses in one step, and of the others in one each.
    """
    rng = np.random.default_rng(0)
    window = made_up_window(default_system, rng)
    start = np.array([[0.25, 0.3, 0.0], [0.3, 4.0, -1.0], [0.0, -1.0, 1.0]])
    channels = ["TRoo", "CO2", "TDryBul", *(["nPer"] if counted else [])]
    found = posterior_variance(default_system, window, start, "sensor", channels)
    rows = [0, 1]
    noise = np.repeat(default_system.noise_sd("sensor")[rows] ** 2, 12)
    design = np.concatenate(
        [m[rows].reshape(24, -1) for m in (window.parameters, window.constants, window.states, window.occupancy)],
        axis=1,
    )
    n = len(default_system.parameters)
    own = n + 2  # standardised: parameters and constants
    if counted:
        means = np.zeros((3, own + 3 + 5))
        means[0, own + 3 : own + 6], means[1, own + 6], means[2, own + 7] = 1 / 3, 1.0, 1.0
        design, noise = np.concatenate([design, means]), np.append(noise, np.full(3, 1e-9))
    prior = np.zeros((own + 3 + 5, own + 3 + 5))
    prior[:own, :own] = np.eye(own)
    prior[own : own + 3, own : own + 3] = start
    prior[own + 3 :, own + 3 :] = window.occupancy_covariance
    data = design @ prior @ design.T + np.diag(noise)
    cross = prior @ design.T
    posterior = prior - cross @ np.linalg.solve(data, cross.T)
    np.testing.assert_allclose(found, np.diag(posterior)[:n], rtol=1e-6)


@pytest.mark.slow
def test_a_person_raises_co2_from_the_hour_of_coming_on(default_system):
    window = random_window(default_system, 24.0, 3, 0)
    assert window.parameters.shape == (4, 24, 8)
    pulses = len(window.occupancy_steps)
    assert window.occupancy.shape == (4, 24, pulses)
    assert 24 < pulses < 144 and np.diag(window.occupancy_covariance).min() > 0  # of ten minutes; nobody comes at night
    co2 = default_system.output_names.index("CO2")
    for pulse, hour in list(enumerate(window.occupancy_steps))[::7]:
        assert np.abs(window.occupancy[co2, :hour, pulse]).max(initial=0.0) < 1e-3
        assert window.occupancy[co2, hour, pulse] > 0.1


@pytest.mark.parametrize(
    ("asked", "said"),
    [
        ({"systems": 0}, "systems is 0; expected at least 1"),
        ({"conditions": [("none", [])]}, "hold no output"),
        (
            {"conditions": [("none", ["TRoo", "TDryBul"]), ("none", ["TRoo", "C02", "time_of_day"])]},
            r"\['C02', 'time_of_day'\] are neither .*'TRoo', .*'TDryBul'",
        ),
        ({"contexts": [24.0, 24.5]}, r"context is 24\.5 h; expected a positive number of whole"),
        ({"contexts": [24.0, float("nan")]}, "context is nan h; expected a positive number of whole"),
    ],
)
def test_what_is_asked_for_must_be_something(default_system, asked, said):
    with pytest.raises(SystemDescriptionError, match=said):
        ceilings_of(default_system, **{"contexts": [24.0], "conditions": [("none", None)], "systems": 1, **asked})


def test_a_preset_says_of_which_records_the_limit_is(house_text, tmp_path, monkeypatch):
    monkeypatch.setattr("datagen.simulating.liveness.check_live_apart", lambda *_, **__: None)
    july = "[presets.july]\nsystems = 3\nhours = 72.0\nstep = 1800.0\nstart = [4344.0, 4700.0]\n"
    (tmp_path / "house.toml").write_text(house_text("N") + july)
    command = ["identifiability", str(tmp_path / "house.toml"), "--context", "24", "--systems", "1", "--workers", "1"]
    out = ["--out", str(tmp_path / "july.json")]
    assert app([*command, "--preset", "july", *out, "--quiet"]) == 0
    (found,) = read_ceilings(tmp_path / "july.json").ceilings
    assert (found.origin.start, found.origin.hours, found.step) == ((4344.0, 4700.0), 72.0, 1800.0)
    with pytest.raises(SystemDescriptionError, match="no preset 'june'; found july"):
        app([*command, "--preset", "june", *out])


def test_counted_persons_are_known_as_means_of_steps(house, monkeypatch):
    system = house("N", "P")
    conditions = [("sensor", channels) for channels in (["room"], ["room", "N"], ["room", "P"], ["room", "To"])]
    found = ceilings_of(system, contexts=[24.0], conditions=conditions, systems=2)
    unknown, counted, other, constant = (limits(one) for one in found)
    assert (counted > unknown + 0.01).any() and (counted >= unknown - 1e-9).all()
    np.testing.assert_array_equal(other, counted)
    np.testing.assert_array_equal(constant, unknown)
    # when within the hour they came is not; it is where a pulse is as long as a step
    for length in (sensitivities.PULSE, 3600.0):
        monkeypatch.setattr(sensitivities, "PULSE", length)
        window = random_window(system, 24.0, 1, 0)
        bare = replace(window, occupancy=window.occupancy[:, :, :0])
        start = np.atleast_2d(np.var(window.visited, axis=0))
        known = posterior_variance(system, window, start, "sensor", ["room", "N"])
        all_ = posterior_variance(system, bare, start, "sensor", ["room"])
        assert (known >= all_ - 1e-9).all()
        np.testing.assert_array_equal((known > all_ + 1e-4).any(), length < 3600.0)
    kept = Ceilings(system_name="House", system_hash="a", fmu_sha256="b", outputs=["room"], nuisances=["N", "P"])
    for one in [*found, *found]:
        kept.put(one)
    assert kept.ceilings == [found[2], found[3]]  # the others are the same conditions by other names
    condition = {"context_hours": 24.0, "step": 3600.0, "noise": "sensor", "constants": {}}
    assert kept.find(**condition, channels=["N", "room"]) == [found[2]]
    assert kept.find(**condition, channels=["room"]) == [found[3]]


@pytest.mark.slow
def test_an_fmu_that_takes_its_process_down_is_a_sentence(tank):
    crashing = faulty.describe(tank.parent, fault=1, above=0)
    with pytest.raises(SimulationError, match=r"faulty\.fmu: took a process down that simulated windows of 24 h"):
        identifiability(crashing, context=24.0, systems=2, workers=2)
