"""``describe``: a draft that runs, whatever the FMU."""

import sys
import tomllib

import numpy as np
import pytest

import datagen
from datagen.fmi.checking import check_system
from datagen.fmi.describe import describe
from datagen.fmi.fmu import Fmu
from shared.errors import FmuError, SystemDescriptionError
from shared.system import load_system, parse_system
from tests.datagen.fmus import rewritten

BOOLEAN = (
    '<ScalarVariable name="oveAct_activate" valueReference="900" causality="input" variability="discrete">'
    '<Boolean start="false"/></ScalarVariable>'
)

TEXT = (
    '<ScalarVariable name="file" valueReference="901" causality="input" variability="discrete">'
    '<String start=""/></ScalarVariable>'
)


@pytest.fixture
def house(small_fmu, tmp_path):
    return rewritten(small_fmu("house"), tmp_path / "house.fmu")


def test_a_draft_estimates_the_parameters_that_are_named(house, tmp_path):
    found = describe(house, out=tmp_path / "system.toml", parameters=["ro"])
    assert load_system(tmp_path / "system.toml").parameter_names == ["ro"]
    assert found.parameters > 1
    assert repr(found).startswith("Description(house.fmu: FMI 2.0, ") and len(repr(found)) < 200
    assert "<table" in found._repr_html_()
    with pytest.raises(FmuError, match=r"'Ro' is not one of its \d+ positive parameters .*; did you mean ro\?$"):
        describe(house, parameters=["Ro"])
    with pytest.raises(FmuError, match=r"'elephant' is not one .*; they are listed by: datagen describe"):
        describe(house, parameters=["elephant"])


def test_a_draft_of_a_house_runs_and_guesses_by_name_and_unit(house, tmp_path):
    found = describe(house, out=tmp_path / "system.toml")
    system = load_system(tmp_path / "system.toml")
    sources = {one.name: (one.source, getattr(one, "column", "")) for one in system.inputs}
    assert sources == {
        "To": ("weather", "temp_air"),
        "S": ("weather", "poa_global"),
        "N": ("constant", ""),
        "P": ("constant", ""),
    }
    assert (found.states, found.inputs, found.outputs, found.without_unit) == (1, 4, 1, ("N",))
    assert {p.name: (p.min, p.max) for p in system.parameters}["ro"] == pytest.approx((7 / 3, 21), rel=1e-3)
    record = datagen.simulate(system, hours=48)
    weather = record["To"].values  # [degC], from a weather year in kelvin
    assert -30 < weather.min() < weather.max() < 45


def test_the_draft_of_the_default_room_runs(tmp_path):
    fmu = load_system("MixedAirCO2").fmu_path
    found = describe(fmu, out=tmp_path / "system.toml")
    system = load_system(tmp_path / "system.toml")
    assert {one.name for one in system.inputs if one.source == "weather"} == {"TDryBul", "TSky", "winSpe", "HFac"}
    assert next(one for one in system.inputs if one.name == "nPer").source == "occupancy"
    assert [p.name for p in system.parameters] == ["gaiCO2.k"]
    assert found.toml.count("[[parameters]]") == found.parameters
    assert datagen.simulate(system, hours=24)["TRoo"].notnull().all()


def test_traits_of_foreign_fmus_end_in_the_draft(small_fmu, tmp_path):
    """A Boolean that overrides, a text, a unit that only the words tell, names that TOML has to quote."""
    traits = (
        ("</ModelVariables>", f"{BOOLEAN}{TEXT}</ModelVariables>"),
        (
            'name="P" valueReference="9" causality="input"',
            'name="P[1]" valueReference="9" description="Heat [kW]" causality="input"',
        ),
        ('<Real start="0.0" unit="kW"/>', '<Real start="0.0"/>'),
        ('name="q"', 'name="q &quot;x&quot;"'),
    )
    found = describe(rewritten(small_fmu("house"), tmp_path / "traits.fmu", *traits))
    made = tomllib.loads(found.toml)
    assert made["fixed"] == {"oveAct_activate": False}
    heat = next(one for one in made["inputs"] if one["name"] == "P[1]")
    assert (heat["unit"], heat["fmu_unit"]) == ("kW", "kW")
    assert 'q "x"' in [one["name"] for one in made["parameters"]]
    check_system(parse_system(found.toml, found.path.parent / "draft.toml"), Fmu(found.path))


@pytest.mark.parametrize(("fmi", "kind"), [(2, "me"), (3, "me"), (2, "cs")])
def test_an_fmu_without_units_or_nominals_that_wants_no_time_before_zero(small_fmu, tmp_path, fmi, kind):
    """And an offset whose range goes through zero; held to the exact solution, 48 h after its start."""
    fmu = small_fmu("odd", fmi, (kind,), attributes='canHandleVariableCommunicationStepSize="true"')
    found = describe(fmu)
    assert found.without_unit == ("y",)
    offset = '[[parameters]]\nname = "offset"\nunit = "1"\nmin = -1.0\nmax = 2.0\n\n'
    toml = found.toml.replace("# what drives the FMU", offset).replace("warm_up_hours = 0.0", "warm_up_hours = 48.0")
    system = parse_system(toml, fmu.parent / "odd.toml").with_experiment(hours=24.0)
    for offset in (-0.7, 0.0, 1.5):
        one = datagen.simulate(system, parameters={"offset": offset})
        exact = np.exp(-float(one["k"]) * (one["time"].values + 48 * 3600)) + offset
        np.testing.assert_allclose(one["y"].values, exact, atol=1e-5 if kind == "me" else 1e-3)


@pytest.mark.skipif(not sys.platform.startswith("linux"), reason="ldd tells what a binary needs")
def test_a_missing_library_is_named_before_and_after_it_is_needed(small_fmu):
    fmu = small_fmu("odd", 2, ("me",), absent=True)
    found = describe(fmu)
    assert found.missing == ("libabsent.so",)
    said = "its binary needs libabsent.so, which this machine lacks; install what brings it"
    assert said in found.sentences()
    with pytest.raises(FmuError, match=said):
        Fmu(fmu)


def test_a_draft_that_does_not_run_says_so(small_fmu, tmp_path, capsys):
    from datagen.cli import app

    bare = rewritten(small_fmu("odd"), tmp_path / "bare.fmu", ('causality="parameter"', 'causality="local"'))
    assert app(["describe", str(bare), "--out", str(tmp_path / "bare.toml")]) == 0
    assert "the draft does not run yet, for the FMU offers no parameter" in " ".join(capsys.readouterr().out.split())


def test_all_mistakes_are_said_at_once_with_what_to_write(small_fmu, tmp_path):
    house = rewritten(small_fmu("house"), tmp_path / "house.fmu", ("</ModelVariables>", f"{BOOLEAN}</ModelVariables>"))
    draft = describe(house).toml
    wrong = draft.replace('name = "To"\nunit = "degC"', 'name = "To"\nunit = "kg"')
    wrong = wrong.replace('name = "N"\nunit = "1"', 'name = "N"\nunit = "m2"').replace(
        '"oveAct_activate" = false\n', ""
    )
    wrong = wrong.replace('name = "ro"', 'name = "roo"')
    (tmp_path / "wrong.toml").write_text(wrong)
    with pytest.raises(SystemDescriptionError) as caught:
        datagen.simulate(tmp_path / "wrong.toml", hours=24)
    said = str(caught.value)
    for words in (
        "4 mistakes",
        "parameter 'roo' is not a variable of house.fmu; did you mean 'ro'?",
        "input 'To' is declared in 'kg'; the FMU has 'degC'; expected a unit of the same kind",
        "house.fmu states no unit of it; expected unit = '1', or fmu_unit = 'm2' beside it",
        "an input 'oveAct_activate' that no [[inputs]] table names; write under [fixed]: \"oveAct_activate\" = false",
    ):
        assert words in said


def test_one_room_in_other_units_is_the_same_room(house, tmp_path):
    """Inputs, parameters and outputs in kelvin and watts, where the FMU has degC and kW, and states no unit of N."""
    base = describe(house).toml
    other = base
    for old, new in (
        ('name = "To"\nunit = "degC"', 'name = "To"\nunit = "K"'),
        ('name = "S"\nunit = "kW/m2"', 'name = "S"\nunit = "W/m2"'),
        ('name = "Y"\nunit = "degC"', 'name = "Y"\nunit = "K"'),
        ('unit = "K/kW"\nmin = 2.333\nmax = 21', 'unit = "K/W"\nmin = 0.002333\nmax = 0.021'),
    ):
        assert old in other
        other = other.replace(old, new)
    (tmp_path / "base.toml").write_text(base)
    (tmp_path / "other.toml").write_text(other)
    one, two = (datagen.simulate(tmp_path / f"{name}.toml", hours=72, seed=3) for name in ("base", "other"))
    np.testing.assert_allclose(two["Y"].values, one["Y"].values + 273.15, atol=1e-4)
    np.testing.assert_allclose(two["S"].values, 1000 * one["S"].values, rtol=1e-6)
    assert float(two["ro"]) == pytest.approx(float(one["ro"]) / 1000, rel=1e-6)


def test_a_description_is_never_written_over(house, tmp_path):
    place = tmp_path / "system.toml"
    place.write_text("mine")
    with pytest.raises(FmuError, match=r"system\.toml: exists; expected a new file"):
        describe(house, out=place)
    assert place.read_text() == "mine"


def test_of_an_fmu_that_is_both_the_kind_is_chosen(small_fmu, tmp_path):
    """Its own solver takes Euler steps, so that it is near and not the same."""
    both = rewritten(small_fmu("house", 2, ("me", "cs")), tmp_path / "both.fmu")
    draft = describe(both).toml
    (tmp_path / "me.toml").write_text(draft)
    (tmp_path / "cs.toml").write_text(draft.replace("fmu =", 'kind = "CoSimulation"\nfmu =', 1))
    me, cs = (datagen.simulate(tmp_path / f"{kind}.toml", hours=48, seed=3)["Y"].values for kind in ("me", "cs"))
    assert 0 < np.abs(me - cs).max() < 0.2
    only = rewritten(small_fmu("house"), tmp_path / "only.fmu")
    (tmp_path / "no.toml").write_text(describe(only).toml.replace("fmu =", 'kind = "CoSimulation"\nfmu =', 1))
    with pytest.raises(FmuError, match="is no FMU of kind 'CoSimulation'; expected kind = 'ModelExchange'"):
        datagen.simulate(tmp_path / "no.toml", hours=24)
