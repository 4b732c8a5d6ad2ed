"""One recording of a blind check: which causes it has, and what they make of a room."""

import sys
from collections import Counter
from types import SimpleNamespace

import netCDF4
import numpy as np
import pytest
import xarray as xr

from diagnosis.blind.generator import Case, Cause, Generator, draw_case, measured, pairs, write
from diagnosis.blind.make import answer_of
from diagnosis.blind.truth import Form
from diagnosis.effects import library
from shared.errors import RecordingError, SystemDescriptionError
from shared.variables import Noise
from tests.small_disk import SAID, small_disk


def only(system, truth, *names):
    """System and truth with these effects alone."""
    return (
        system.model_copy(update={"effects": [one for one in system.effects if one.name in names]}),
        truth.model_copy(update={"forms": [one for one in truth.forms if not one.effect or one.effect in names]}),
    )


@pytest.mark.parametrize("names", [["plug"], ["window.warm", "window.airing"]])
def test_two_causes_that_cannot_act_together_are_refused_before_anything_is_made(default_system, truth, names):
    system, fewer = only(default_system, truth, *names)
    assert pairs(fewer, library(system)) == {}
    with pytest.raises(SystemDescriptionError, match=r"strata\.two is above 0, and no two effects can act together"):
        Generator(system, fewer, hours=24.0)


def recording(steps):
    about = {"units": "seconds since 2001-01-01 00:00:00", "calendar": "standard"}
    values = np.sin(np.arange(steps)).astype(np.float32)
    values[1] = np.nan
    return xr.Dataset({"T": ("time", values, {"units": "K"})}, {"time": ("time", 3600.0 * np.arange(steps), about)})


def test_a_file_is_read_by_the_c_library_as_it_was_written(tmp_path):
    write(tmp_path / "a.nc", recording(24))
    with netCDF4.Dataset(tmp_path / "a.nc") as found:
        assert found.data_model == "NETCDF3_64BIT_OFFSET"
        np.testing.assert_array_equal(found["T"][...].filled(np.nan), recording(24)["T"].values)
        assert found["T"].ncattrs() == ["units"]
        assert found["time"].units == "seconds since 2001-01-01 00:00:00"
    before = (tmp_path / "a.nc").read_bytes()
    write(tmp_path / "b.nc", recording(24))
    assert (tmp_path / "b.nc").read_bytes() == before


@pytest.mark.skipif(sys.platform == "win32", reason="no limit of a file's size there")
def test_a_full_disk_is_a_sentence_and_leaves_all_as_it_was(tmp_path):
    path = tmp_path / "a.nc"
    write(path, recording(24))
    before = path.read_bytes()
    with small_disk(), pytest.raises(RecordingError, match=rf"a\.nc: cannot be written \({SAID}\); expected a place"):
        write(path, recording(8760))
    assert list(tmp_path.iterdir()) == [path]
    assert path.read_bytes() == before


def test_noise_has_the_size_and_the_colour_that_the_truth_says():
    """Of a variance of 4, three tenths with a memory of five steps: correlation 0.3 exp(-1/5) from step to step."""
    steps = 50_000
    rng = np.random.default_rng(3)
    made = SimpleNamespace(
        clean=np.zeros((1, steps)), time=3600.0 * np.arange(steps), case=SimpleNamespace(rng=lambda purpose: rng)
    )
    system = SimpleNamespace(outputs=[SimpleNamespace(name="T", noise={"good": Noise(sd=2.0)})])
    truth = SimpleNamespace(measuring=SimpleNamespace(noise="good", slow=0.3, hours=(5.0, 5.0)))
    ((shown,), noises) = measured(made, system, truth)
    assert shown.std() == pytest.approx(2.0, rel=0.01)
    assert np.corrcoef(shown[1:], shown[:-1])[0, 1] == pytest.approx(0.2456, abs=0.015)
    assert noises == {"T": {"sd": 2.0, "slow_share": 0.3, "hours": pytest.approx(5.0)}}


HOURS, SEED = 72.0, 20


@pytest.fixture(scope="module")
def generator(default_system, truth):
    return Generator(default_system, truth, hours=HOURS)


def test_strata_come_as_often_as_declared_and_every_candidate_has_its_turn(default_system, truth):
    effects = library(default_system)
    block = len(truth.strata.order)
    cases = [draw_case(truth, effects, 5, index) for index in range(10 * block)]
    counted = Counter(case.stratum for case in cases)
    assert counted == {name: 10 * count for name, count in truth.strata.model_dump().items()}
    plain = Counter(case.causes[0].label for case in cases if case.stratum == "library")
    assert set(plain) == {effect.name for effect in effects}
    assert max(plain.values()) - min(plain.values()) <= 1
    assert {case.causes[0].form for case in cases if case.stratum == "outside"} == {form.name for form in truth.outside}
    # order tells nothing: the first of a block is of any stratum
    assert len({case.stratum for case in cases[::block]}) >= 4
    for case in cases:
        labels = [cause.label for cause in case.causes]
        assert len(labels) == {"none": 0, "two": 2}.get(case.stratum, 1)
        assert len(set(labels)) == len(labels)
        assert (case.stratum == "outside") == ("" in labels)
        for cause in case.causes:
            size = abs(cause.amplitude) / cause.acts.scale
            assert size <= truth.amplitudes[1] * (1 + 1e-9)
            if isinstance(cause.acts, Form):
                assert abs(cause.amplitude) <= cause.acts.limit
                assert not case.replay or "replay" in cause.acts.modes
            else:
                assert cause.acts.lower <= cause.amplitude <= cause.acts.upper
                assert not case.replay or "replay" in cause.acts.spec.modes
    assert 0.3 < np.mean([case.unknown_occupancy for case in cases]) < 0.7
    assert 0.2 < np.mean([case.replay for case in cases]) < 0.4
    other = [draw_case(truth, effects, 6, index).stratum for index in range(3 * block)]
    assert other != [case.stratum for case in cases[: 3 * block]]


def case_of(truth, default_system, name, amplitude, index=3, replay=False):
    """A recording with one cause of a given name and amplitude, persons counted."""
    acts = {form.name: form for form in truth.forms} | {effect.name: effect for effect in library(default_system)}
    causes = (Cause(acts[name], amplitude),) if name else ()
    return Case(SEED, index, "library" if name else "none", causes, unknown_occupancy=False, replay=replay)


@pytest.mark.parametrize("replay", [False, True])
def test_without_a_cause_the_base_model_misses_little(generator, truth, default_system, replay):
    made = generator.make_case(case_of(truth, default_system, "", 0.0, replay=replay))
    gap = np.sqrt(np.mean((made.clean - made.base) ** 2, axis=1))
    assert 0 < gap[0] < 0.25  # the walls', and in replay the hourly means of the actuators
    assert gap[1] < 5.0
    answer = answer_of(made, measured(made, default_system, truth)[1], default_system)
    assert (answer["verdict"], answer["effects"]) == ("no_gap", [])


def test_no_building_is_as_described(generator, truth, default_system):
    """The truth's constants are drawn; the answer tells them, and the base model of the answer has them."""
    case = case_of(truth, default_system, "", 0.0, COLD)
    made = generator.make_case(case)
    drawn = np.log(list(made.constants.values())) / [one.relative for one in default_system.uncertain]
    assert list(made.constants) == [one.name for one in default_system.uncertain]
    assert np.all(np.abs(drawn) < 4.0) and np.all(drawn != 0.0)
    known = truth.model_copy(update={"measuring": truth.measuring.model_copy(update={"constants": False})})
    described = Generator(default_system, known, hours=HOURS).make_case(case)
    assert described.constants == {}
    assert described.parameters == made.parameters
    room, heat = default_system.output_names.index("TRoo"), default_system.output_names.index("QHea")
    for series in ("clean", "base"):
        there, other = getattr(made, series), getattr(described, series)
        # a room that is heated: its power tells, and what its controller lets through of the temperature
        assert np.std((there - other)[heat]) > 50.0
        assert np.std((there - other)[room]) > 0.02
    gap = np.sqrt(np.mean((made.clean - made.base) ** 2, axis=1))
    assert 0 < gap[room] < 0.25
    answer = answer_of(made, measured(made, default_system, truth)[1], default_system)
    assert answer["constants"] == made.constants


@pytest.mark.parametrize(
    ("name", "amplitude", "channel", "sign"),
    [
        ("short circuit at high flow", 0.9, "CO2", 1),
        ("fan off on most nights", 1.0, "mOA", -1),
        ("sensor.CO2.bias", 150.0, "CO2", 1),
        ("window.warm", 1.0, "TRoo", None),
    ],
)
def test_causes_act_with_the_expected_sign(generator, truth, default_system, name, amplitude, channel, sign):
    # the same room in winter for all but the windows, which want warmth
    made = generator.make_case(case_of(truth, default_system, name, amplitude, WARM if sign is None else COLD))
    gap = (made.clean - made.base)[default_system.output_names.index(channel)]
    floor = default_system.outputs[default_system.output_names.index(channel)].accuracy
    assert np.sqrt(np.mean(gap**2)) > 3 * floor
    if sign is not None:
        assert np.mean(gap) * sign > 0


COLD, WARM = 11, 0
"""Numbers of recordings that fall into winter and summer with this seed: found below."""
