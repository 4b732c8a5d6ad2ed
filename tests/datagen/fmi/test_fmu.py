"""A description that does not fit its FMU is refused, by name."""

from pathlib import Path

import pytest

from datagen.fmi.checking import check_system
from datagen.fmi.fmu import Fmu
from datagen.simulating.liveness import HARDLY, _judged, check_live, check_live_apart, responses
from datagen.simulating.simulator import Simulator
from shared.errors import SystemDescriptionError
from shared.system import load_system, parse_system
from tests.datagen.faults import faulty
from tests.datagen.fmus import rewritten


@pytest.fixture(scope="module")
def toml(default_system):
    return default_system.path.read_text().replace('fmu = "../MixedAirCO2.fmu"', f'fmu = "{default_system.fmu_path}"')


@pytest.mark.parametrize(
    ("old", "new", "words"),
    [
        ('name = "roo.V"', 'name = "roo.Volume"', ["'roo.Volume'", "not a variable", "'roo.V'"]),
        ('unit = "m3"', 'unit = "kg"', ["'roo.V'", "'kg'", "'m3'", "of the same kind"]),
        ('name = "TDryBul"', 'name = "TOutdoor"', ["'TOutdoor'", "not a variable"]),
        ("[fixed]", '[fixed]\n"conHea.kk" = 1.0', ["fixed", "'conHea.kk'", "conHea.k"]),
        ("[fixed]", "[fixed]\nreplay = 0.5", ["fixed 'replay' is set to 0.5 and is a Boolean; expected true or false"]),
        (
            "[fixed]",
            '[[parameters]]\nname = "effect.adjacent.T"\nunit = "K"\nmin = 11.0\nmax = 18.0\n[fixed]',
            [
                "parameter 'effect.adjacent.T': its range is 11 to 18 K; expected 223.15 to 333.15 K; is it in degC or"
                " degF?",
                'relativeQuantity="true"',
            ],
        ),
        ("[fixed]", "[fixed]\nTSky = 280.0", ["fixed 'TSky' is one of [[inputs]]", "expected it in one of the two"]),
    ],
)
def test_each_misfit_is_one_sentence(toml, default_system, old, new, words):
    assert old in toml
    text = toml.replace(old, new, 1)
    system = parse_system(text, Path("mine.toml"))
    with pytest.raises(SystemDescriptionError) as caught:
        check_system(system, Fmu(system.fmu_path))
    for word in ["mine.toml", *words]:
        assert word in str(caught.value)


def test_a_value_of_another_kind_is_not_rounded(tmp_path):
    path = faulty.build(tmp_path)
    rewritten(path, path, ('<Real start="0"/>', '<Integer start="0"/>'))
    with pytest.raises(
        SystemDescriptionError, match=r"fixed 'fault' is set to 2\.7 and is an Integer; expected a whole"
    ):
        Simulator(load_system(faulty.describe(tmp_path, fault=2.7)))
    simulator = Simulator(load_system(faulty.describe(tmp_path)))
    with pytest.raises(SystemDescriptionError, match=r"faulty\.fmu: 'fault' is set to 0\.5 and is an Integer"):
        simulator.fmu.set_value("fault", 0.5)


def test_every_parameter_of_the_default_moves_an_output(default_system):
    found = responses(Simulator(default_system))
    assert set(found) == set(default_system.parameter_names)
    assert min(found.values()) > 10  # ten times the accuracy of an output


IGNORED = '[[parameters]]\nname = "effect.adjacent.T"\nunit = "K"\nmin = 280.0\nmax = 300.0\n\n'


def test_a_parameter_that_the_fmu_ignores_is_refused(toml):
    system = parse_system(toml.replace("[[parameters]]\n", f"{IGNORED}[[parameters]]\n", 1), Path("mine.toml"))
    for check in (lambda: check_live(Simulator(system)), lambda: check_live_apart(system)):
        with pytest.raises(SystemDescriptionError, match=r"accepts 'effect\.adjacent\.T' and ignores it"):
            check()


def test_what_acts_in_summer_alone_is_not_ignored(toml, monkeypatch):
    """A look at winter days finds nothing of a parameter that the summer's outputs follow."""
    simulator = Simulator(parse_system(toml, Path("mine.toml")))
    real = simulator.run

    def run(parameters, inputs, *, start, **words):
        return real({**parameters, "roo.V": 200.0} if start == 0 else parameters, inputs, start=start, **words)

    monkeypatch.setattr(simulator, "run", run)
    assert responses(simulator, ["roo.V"])["roo.V"] > 1


def test_what_is_weak_is_refused_for_a_dataset_and_not_for_its_limit(default_system):
    assert _judged(default_system, {"roo.V": 0.5}, HARDLY) == {"roo.V": 0.5}
    with pytest.raises(SystemDescriptionError, match=r"moves by its accuracy for 'roo\.V' \(0\.5 of it\)"):
        _judged(default_system, {"roo.V": 0.5, "roo.hRoo": 2.0})
    with pytest.raises(SystemDescriptionError, match=r"accepts 'roo\.V' and ignores it"):
        _judged(default_system, {"roo.V": 0.0}, HARDLY)
