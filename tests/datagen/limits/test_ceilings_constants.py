"""The limit where constants are uncertain, against a house that is solved by hand.

c T' = (To - T) / ro + a S + q N, and the meter shows T. With S and N held the area a, which is estimated, and the heat
of a person q, which is not, do exactly the same.
"""

import json

import numpy as np
import pytest

import datagen.limits.sensitivities as sensitivities
from datagen import identifiability
from datagen.cli import app
from datagen.driving.sampling import sample_parameters
from datagen.farming.farm import _copy_ceilings
from datagen.fmi.fmu import fmu_sha256
from datagen.limits.sensitivities import random_window
from datagen.simulating.constants import sample_factors
from shared.ceiling import FILE_NAME, Ceilings, Origin, read_ceilings, unknown_constants, write_ceilings
from shared.system import parse_system

HOUSE = """
schema_version = 1
name = "House"
fmu = "{fmu}"
[experiment]
hours = 48.0
warm_up_hours = 24.0
tolerance = 1e-9
[estimator]
channels = ["room"]
[fixed]
ro = 8.0
ri = 0.0
c = 2.0
[[parameters]]
name = "a"
unit = "m2"
min = 1.0
max = 4.0
[[outputs]]
name = "room"
variable = "Y"
unit = "degC"
method = "point"
accuracy = 0.01
noise.sensor = {{ sd = 0.05 }}
"""
INPUTS = "".join(
    f'[[inputs]]\nname = "{name}"\nunit = "{unit}"\nsource = "constant"\nvalue = {value}\n'
    for name, unit, value in (("To", "degC", 10.0), ("S", "kW/m2", 0.5), ("N", "1", 10.0), ("P", "kW", 0.0))
)
HEAT = '[[uncertain]]\nname = "heat"\nparameters = ["q"]\nrelative = 0.3\n'
MASS = '[[uncertain]]\nname = "mass"\nparameters = ["c"]\nrelative = 0.2\n'
RO, SUN, PERSONS, Q, FIRST = 8.0, 0.5, 10.0, 0.1, 18.0
"""What is fixed and held; q [kW] and the temperature that every run begins at [degC] are the FMU's own."""
AREA = 3 / np.sqrt(12)
"""Prior standard deviation of a [m2]."""
HOURS = np.arange(1.0, 25.0)


@pytest.fixture(scope="module")
def house(small_fmu):
    """``house(HEAT, MASS)``: a house with these uncertain constants."""
    fmu = small_fmu("house", attributes='canHandleVariableCommunicationStepSize="true"')

    def make(*uncertain):
        return parse_system(HOUSE.format(fmu=fmu.as_posix()) + INPUTS + "".join(uncertain), fmu.parent / "house.toml")

    return make


@pytest.fixture(autouse=True)
def solvable(monkeypatch):
    """After ten days the house has settled, and its mass would tell nothing; a tight solver agrees with the pencil."""
    monkeypatch.setattr(sensitivities, "SPIN_UP_HOURS", 24.0)
    monkeypatch.setattr(sensitivities, "TOLERANCE", 1e-11)


def by_hand(system, index):
    """By area, heat, mass (per prior standard deviation) and temperature at the start, (24,) each; P of the latter."""
    heat, mass = (*sample_factors(system, 1, index), 1.0)[:2]
    tau = RO * 2.0 * mass
    settled = 10.0 + RO * (SUN * sample_parameters(system, 1, index)[0] + PERSONS * Q * heat)
    path = settled + (FIRST - settled) * np.exp(-np.arange(25) / tau)
    decay = np.exp(-HOURS / tau)
    return (
        *(RO * SUN * AREA * (1 - decay), RO * PERSONS * Q * heat * 0.3 * (1 - decay)),
        *((path[-1] - settled) * decay * HOURS / tau * 0.2, decay, np.var(path)),
    )


@pytest.mark.parametrize("index", [0, 3])
def test_sensitivities_are_those_of_the_solution(house, index):
    """About the drawn constants, with the temperature held that the house has at the start."""
    system = house(HEAT, MASS)
    window = random_window(system, 24.0, 1, index, uncertain=True)
    area, heat, mass, state, start = by_hand(system, index)
    assert np.abs(sample_factors(system, 1, index) - 1).min() > 0.02  # otherwise it would pass without any drawn
    np.testing.assert_allclose(window.constants, np.stack([heat, mass], axis=-1)[None], rtol=1e-4, atol=1e-6)
    np.testing.assert_allclose(window.parameters[0, :, 0], area, rtol=1e-3)
    np.testing.assert_allclose(window.states[0, :, 0], state, rtol=1e-4)
    assert window.visited.var() == pytest.approx(start, rel=1e-4)
    assert np.abs(mass).max() > 0.05


@pytest.mark.parametrize("uncertain", [(HEAT,), (HEAT, MASS)])
@pytest.mark.parametrize(("noise", "sd"), [("none", 0.01), ("sensor", np.hypot(0.05, 0.01))])
def test_the_limit_is_that_of_gaussian_arithmetic(house, uncertain, noise, sd):
    """Constants and temperature beside the area in the information form, where none of them is noise.

    The heat of persons does what the area does: even without noise no more than its part of the variance is known.
    """
    system = house(*uncertain)
    found = identifiability(system, context=24.0, noise=noise, systems=1, uncertain=True)
    area, heat, mass, state, start = by_hand(system, 0)
    constants = [heat, mass][: len(uncertain)]
    design = np.stack([area, *constants, state], axis=-1) / sd
    posterior = np.linalg.inv(np.diag([*np.ones(1 + len(uncertain)), 1 / start]) + design.T @ design)
    assert found.r2["a"] == pytest.approx(1 - posterior[0, 0], rel=1e-3)
    assert found.r2["a"] < 0.95


def test_the_command_keeps_both_limits(house, tmp_path, capsys, monkeypatch):
    monkeypatch.setattr("datagen.simulating.liveness.check_live_apart", lambda *_, **__: None)
    folder = tmp_path / "house"
    folder.mkdir()
    (folder / "house.toml").write_text(HOUSE.format(fmu=house().fmu_path.as_posix()) + INPUTS + HEAT)
    words = ["identifiability", str(folder / "house.toml"), "--context", "24", "--systems", "1", "--workers", "1"]
    for uncertain in ([], ["--uncertain"]):
        assert app([*words, *uncertain], result_action="return_value") == 0
        assert ("constants drawn (heat 0.3)" in capsys.readouterr().out) == bool(uncertain)
    drawn = unknown_constants(house(HEAT).uncertain)
    assert [one.constants for one in read_ceilings(folder / FILE_NAME).ceilings] == [{}, drawn]
    assert app([*words, "--noise", "none", "sensor", "--json"], result_action="return_value") == 0
    exact, noisy = json.loads(capsys.readouterr().out)
    assert (exact["noise"], noisy["noise"], {*exact["r2"]}) == ("none", "sensor", {"a"})
    assert exact["r2_mean"] > noisy["r2_mean"]


@pytest.mark.parametrize(
    ("drawn", "taken", "said"),
    [
        (True, (HEAT,), ""),
        (True, (MASS,), "it has none with constants drawn (heat 0.3)"),
        (False, (HEAT,), "it has none with constants as declared"),
    ],
)
def test_limits_are_put_beside_data_with_their_constants_alone(house, tmp_path, caplog, drawn, taken, said):
    caplog.set_level("INFO", "zeroshot")
    system = house(HEAT).model_copy(update={"path": tmp_path / "house.toml"})
    limit = identifiability(house(HEAT), context=24.0, systems=1).model_copy(
        update={
            "origin": Origin(start=(0.0, 0.0), hours=48.0, warm_up_hours=24.0),
            "constants": unknown_constants(house(*taken).uncertain),
        }
    )
    write_ceilings(
        tmp_path / FILE_NAME,
        Ceilings(
            system_name="House",
            system_hash=system.hash(),
            fmu_sha256=fmu_sha256(system.fmu_path),
            outputs=["room"],
            ceilings=[limit],
        ),
    )
    (tmp_path / "ds").mkdir()
    _copy_ceilings(system, tmp_path / "ds", excitation=True, uncertain=drawn)
    assert (tmp_path / "ds" / FILE_NAME).exists() == (not said)
    assert (f"not copied: {said}" in caplog.text) == bool(said)
