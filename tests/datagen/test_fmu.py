"""A description that does not fit its FMU is refused, by name."""

from pathlib import Path

import pytest

from datagen.fmu import Fmu, check_system
from datagen.liveness import check_live, responses
from datagen.simulator import Simulator
from shared.errors import FmuError, SystemDescriptionError
from shared.system import parse_system


@pytest.fixture(scope="module")
def toml(default_system):
    return default_system.path.read_text().replace('fmu = "../MixedAirCO2.fmu"', f'fmu = "{default_system.fmu_path}"')


@pytest.mark.parametrize(
    ("old", "new", "words"),
    [
        ('name = "roo.V"', 'name = "roo.Volume"', ["'roo.Volume'", "not a variable", "'roo.V'"]),
        ('name = "roo.V"', 'name = "TMRT"', ["'TMRT'"]),
        ('unit = "m3"', 'unit = "litre"', ["'roo.V'", "'litre'", "'m3'"]),
        ('name = "TDryBul"', 'name = "TOutdoor"', ["'TOutdoor'", "not a variable"]),
        ('[[outputs]]\nname = "TRoo"', '[[outputs]]\nname = "TRoo"\nvariable = "TAir"', ["'TAir'"]),
        ("[fixed]", '[fixed]\n"conHea.kk" = 1.0', ["fixed", "'conHea.kk'", "conHea.k"]),
        ('name = "excOut"', 'name = "fraWin"', ["input 'fraWin'"]),
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


def test_an_input_that_nobody_declares_is_refused(toml):
    start = toml.index('[[inputs]]\nname = "winSpe"')
    end = toml.index("[[inputs]]", start + 5)
    system = parse_system(toml[:start] + toml[end:], Path("mine.toml"))
    with pytest.raises(SystemDescriptionError, match="'winSpe'"):
        check_system(system, Fmu(system.fmu_path))


def test_files_that_are_no_fmu(tmp_path):
    with pytest.raises(FmuError, match="no such file"):
        Fmu(tmp_path / "nothing.fmu")
    (tmp_path / "text.fmu").write_text("this is not a zip")
    with pytest.raises(FmuError, match="not a readable FMU"):
        Fmu(tmp_path / "text.fmu")


def test_every_parameter_of_the_default_moves_an_output(default_system):
    found = responses(Simulator(default_system))
    assert set(found) == set(default_system.parameter_names)
    assert min(found.values()) > 10  # ten times the accuracy of an output


def test_a_parameter_that_the_fmu_ignores_is_refused(toml):
    dead = '[[parameters]]\nname = "effect.adjacent.T"\nunit = "K"\nmin = 280.0\nmax = 300.0\n\n[[parameters]]\n'
    system = parse_system(toml.replace("[[parameters]]\n", dead, 1), Path("mine.toml"))
    with pytest.raises(SystemDescriptionError, match=r"accepts 'effect\.adjacent\.T' and ignores it"):
        check_live(Simulator(system))
