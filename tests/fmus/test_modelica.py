"""The Modelica package: compiled by rumoca against stand-ins of the libraries, and held against the C twin.

The stand-ins (``standins``) have the names and interfaces of the library classes that the package uses, with simple
physics of our own. So names, connections, units, equation counts and what each parameter does are checked; the
library's own equations, its records and the export are not.
"""

import re
import tomllib
from pathlib import Path

import fmpy
import numpy as np
import pytest

from datagen.comparing.recorded import load_recorded
from fmus.modelica import verify
from shared.errors import RecordingError
from shared.system import load_system

ROOT = Path(__file__).resolve().parents[2]
RECIPE = ROOT / "fmus" / "modelica"
PACKAGE = RECIPE / "ZeroshotRoom"
STANDINS = Path(__file__).resolve().parent / "standins"
FMU = ROOT / "fmus" / "MixedAirCO2.fmu"
DAY = 86400.0

# the twin's names of what the Modelica room has under its own
CHANGES = {
    "gaiCO2.k": 1.1e-5, "roo.AFlo": 90.0, "roo.hRoo": 3.7, "roo.V": 80.0, "matExtWal.R": 0.8,
    "glaSys.UFra": 2.8, "glaSys.absSolFra": 0.35, "mOut_flow": 0.08,
}  # fmt: skip
EFFECTS = {
    "effect.infiltration.m0": 0.01, "effect.infiltration.cWind": 0.002, "effect.infiltration.cStack": 0.001,
    "effect.bridge.UA": 20.0, "effect.adjacent.UA": 30.0, "effect.adjacent.T": 297.0,
    "effect.plug.Q": 200.0, "effect.shading.fra": 0.2, "effect.heater.derate": 0.3, "effect.mixing.bypass": 0.15,
    "effect.valve.Q": 100.0,
}  # fmt: skip


@pytest.fixture(scope="module")
def rumoca():
    return pytest.importorskip("rumoca")


@pytest.fixture(scope="module")
def compile_room(rumoca):
    """``compile_room(text)``: a model named X, given its declarations and equations, with the package at hand."""
    session = rumoca.Session(roots=[str(STANDINS / "Modelica"), str(STANDINS / "Buildings"), str(PACKAGE)])

    def compile_it(text):
        # the compiler loads the libraries that the text names
        names = "constant Real tilt = Buildings.Types.Tilt.Wall; constant Real turn = Modelica.Constants.pi;"
        return session.loads(f"model X {names} {text} end X;", model="X")

    return compile_it


@pytest.fixture(scope="module")
def room(compile_room):
    return compile_room("extends ZeroshotRoom.TunableRoom;")


@pytest.fixture(scope="module")
def verification(compile_room):
    return compile_room("extends ZeroshotRoom.Verification;")


@pytest.fixture(scope="module")
def twin_system():
    return load_system(verify.DEFAULT_SYSTEM)


def rms(a, b):
    return np.sqrt(np.mean((np.asarray(a) - np.asarray(b)) ** 2, axis=-1))


# ---------------------------------------------------------------- sources


def test_every_source_is_clean(rumoca):
    sources = sorted(PACKAGE.rglob("*.mo"))
    assert len(sources) >= 15
    for path in sources:
        assert [str(one.message) for one in rumoca.validate(str(path))] == [], path


def test_scripts_export_every_room():
    rooms = {path.stem for path in PACKAGE.glob("*.mo")} - {"package", "Verification"}
    for script in ("export.mos", "export_dymola.mos"):
        made = re.findall(
            r"(?:buildModelFMU\(|translateModelFMU\(\")ZeroshotRoom\.(\w+)", (RECIPE / script).read_text()
        )
        assert set(made) == rooms, script


# ---------------------------------------------------------------- interface


def test_room_is_balanced_and_has_the_twins_interface(room):
    structure = room.structure()
    assert structure.is_balanced
    assert structure.n_equations == structure.n_unknowns
    twin = {v.name: v for v in fmpy.read_model_description(str(FMU)).modelVariables}
    assert {one.name for one in room.inputs} == {n for n, v in twin.items() if v.causality == "input"}
    outputs = {n for n, v in twin.items() if v.causality == "output"}
    assert outputs <= {one.name for one in room.outputs}
    for one in [*room.inputs, *(o for o in room.outputs if o.name in outputs)]:
        assert one.unit == twin[one.name].unit, one.name
    parameters = {one.name: one for one in room.parameters}
    for name in [*CHANGES, *EFFECTS]:
        assert parameters[name].unit == twin[name].unit, name
        assert parameters[name].value == float(twin[name].start), name


# ---------------------------------------------------------------- what the room does


def test_room_moves_like_the_twin(verification, twin_system):
    """The stand-ins' physics is the twin's but for the wind at the facade, so the rest must be."""
    made = verification.simulate(t=(0.0, 2 * DAY), dt=3600.0)
    ours = np.array([made[name][1:] for name in twin_system.output_names])
    twin = verify.simulated(twin_system, 2 * DAY)
    assert np.all(rms(ours, twin) < [0.03, 0.1, 15.0, 1e-4]), rms(ours, twin)
    # it is a test of something: loops that work, and persons that come
    assert np.ptp(twin[0]) > 4
    assert twin[1].max() > 1100
    assert twin[3].max() > 0.2


@pytest.mark.slow
def test_parameters_mean_what_they_mean_in_the_twin(verification, twin_system):
    changes = CHANGES | EFFECTS
    given = {f"room.{name}": value for name, value in changes.items()}
    made = verification.simulate(t=(0.0, 2 * DAY), dt=3600.0, params=given)
    ours = np.array([made[name][1:] for name in twin_system.output_names])
    before = verify.simulated(twin_system, 2 * DAY)
    twin = verify.simulated(twin_system.model_copy(update={"fixed": changes, "parameters": [], "effects": []}), 2 * DAY)
    assert np.all(rms(ours, twin) < 0.05 * rms(before, twin) + [0.01, 0.1, 10.0, 1e-4]), rms(ours, twin)
    assert np.all(rms(before, twin) > [0.5, 50.0, 100.0, 0.01])


@pytest.mark.slow
def test_replay_feeds_the_actuators(compile_room):
    replayed = compile_room(
        """ZeroshotRoom.TunableRoom room(replay=true);
        equation room.TDryBul = 275.15; room.TSky = 265.15; room.winSpe = 2; room.HFac = 0; room.CO2Out = 420;
        room.nPer = 5; room.TSet = 320; room.excHea = 999; room.excOut = 9; room.QHea_in = 1500 + 500*sin(time/7000);
        room.mOA_in = 0.06; room.yWin = 0; room.yPlu = 0; room.yOff = 0; room.ySha = 0;"""
    )
    made = replayed.simulate(t=(0.0, DAY), dt=3600.0)
    time = np.asarray(made.time)
    np.testing.assert_allclose(made["room.QHea"], 1500 + 500 * np.sin(time / 7000), atol=0.5)
    np.testing.assert_allclose(made["room.mOA"], 0.06, atol=1e-9)
    # five persons, 0.06 kg/s, 150 m3 of air: the exponential
    rise = 5 * 9e-6 / 0.06 * 1e6 * 28.9647 / 44.0095
    expected = 420 + rise - (20 + rise) * np.exp(-0.06 * time / (1.2 * 150))
    np.testing.assert_allclose(made["room.CO2"], expected, atol=0.1)
    assert np.ptp(made["room.conHea.xI"]) == 0


def test_weather_from_a_file_takes_the_place_of_the_inputs(compile_room):
    """The stand-in's reader gives 275.15 K and 300 W/m2, of which half and a fifth reach the facade."""
    inputs = [v.name for v in fmpy.read_model_description(str(FMU)).modelVariables if v.causality == "input"]
    zero = "".join(f"room.{name} = {294.15 if name == 'TSet' else 0};" for name in inputs)
    made = compile_room(f"ZeroshotRoom.TunableRoomWeatherFile room; equation {zero}")
    assert made.structure().is_balanced
    done = made.simulate(t=(0.0, 7200.0), dt=3600.0)
    assert done["room.HTot.y"][-1] == pytest.approx(0.5 * 300 + 0.2 * 300)
    assert done["room.TOut.y"][-1] == pytest.approx(275.15)
    assert done["room.TRoo"][-1] > 288


def test_mapping_of_recorded_rooms_fits_the_description(twin_system, tmp_path):
    """Everything that it names is declared: what it misses are the files alone."""
    with pytest.raises(RecordingError, match=r"systems\.csv: no such file"):
        load_recorded(RECIPE / "recorded-rooms.toml", twin_system, tmp_path)
    fixed = tomllib.loads((RECIPE / "recorded-rooms.toml").read_text())["recorded"]["fixed"]
    variables = {v.name for v in fmpy.read_model_description(str(FMU)).modelVariables}
    assert set(fixed) <= variables
