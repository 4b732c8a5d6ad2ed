"""A wrong system description gets one sentence that names the field."""

from pathlib import Path

import numpy as np
import pytest
from hypothesis import example, given
from hypothesis import strategies as st

from shared.errors import SystemDescriptionError
from shared.system import load_system, parse_system, system_from_canonical
from shared.variables import Parameter

ROOT = Path(__file__).resolve().parents[2]
TOML = ROOT / "fmus" / "MixedAirCO2" / "system.toml"


def test_default_system_is_table_1():
    system = load_system(TOML)
    table_1 = {
        "gaiCO2.k": (6e-6, 1.2e-5, "kg/s"),
        "roo.AFlo": (60.0, 200.0, "m2"),
        "roo.hRoo": (2.5, 4.0, "m"),
        "roo.V": (40.0, 300.0, "m3"),
        "matExtWal.R": (0.5, 3.0, "m2.K/W"),
        "glaSys.UFra": (1.0, 3.0, "W/(m2.K)"),
        "glaSys.absSolFra": (0.3, 0.7, "1"),
        "mOut_flow": (0.05, 0.5, "kg/s"),
    }
    assert {p.name: (p.min, p.max, p.unit) for p in system.parameters} == table_1
    assert list(table_1) == system.parameter_names
    assert all(p.scale == "linear" for p in system.parameters)


def test_a_description_that_is_not_saved_as_utf_8_is_told_the_line(tmp_path):
    path = tmp_path / "system.toml"
    path.write_bytes('schema_version = 1\nname = "Büro"\n'.encode("latin-1"))
    with pytest.raises(SystemDescriptionError, match=r"system\.toml: line 2: the byte 0xfc .*; save the file as UTF-8"):
        load_system(path)


@pytest.mark.parametrize(
    ("old", "new", "words"),
    [
        ('unit = "m2"\nmin', "min", ["parameters 'roo.AFlo'", "no unit"]),
        ('unit = "m2"\nmin', 'units = "m2"\nmin', ["parameters[2].units: unknown field", "; did you mean unit?"]),
        ("min = 60.0", "min = 600.0", ["parameters[2]", "range is reversed", "600", "200"]),
        ("min = 60.0", 'scale = "log"\nmin = -1.0', ["parameters[2]", "min is -1", 'or scale = "linear"']),
        ('source = "occupancy"', 'source = "crystal ball"', ["inputs[6]", "crystal ball"]),
        ('schedule = "set_point"', 'schedule = "nights"', ["inputs", "'TSet'", "'nights'"]),
        ("[replay]", '[replay]\n"roo.V" = 100.0', ["replay: 'roo.V' is also an estimated parameter"]),
        ("step = 3600.0", "step = 3601.0", ["step 3601 s does not divide"]),
        ("[experiment]", "[experiment", ["not valid TOML"]),
        ('channels = ["TRoo", "CO2"]', 'channels = ["TRoo", "H2O"]', ["estimator.channels", "'H2O'"]),
        ('name = "CO2"', 'name = "CO_2"', ["estimator.channels: 'CO2' is neither", "; did you mean CO_2?"]),
        ('name = "roo.V"', 'name = "roo.AFlo"', ["parameters", "'roo.AFlo'", "twice"]),
        ("headcount = [5, 25]", "headcount = [25, 5]", ["occupancy", "headcount", "[25, 5]"]),
        ("period = 7.3", "period = 1e-6", ["period", "0.0166"]),
        ("schema_version = 1", "schema_version = 2", ["schema_version", "2"]),
        (
            "weekday = [[0.0, 290.15], [6.0, 294.15], [22.0, 290.15]]",
            "weekday = [[0.0, 17.0], [6.0, 21.0], [22.0, 17.0]]",
            [
                "schedules.set_point: weekday, from hour 0, of input 'TSet': is 17 K; expected 223.15 to 333.15 K;"
                " is it in degC or degF?"
            ],
        ),
        (
            'unit = "W"\nsource = "measured"',
            'unit = "kW"\nsource = "measured"',
            ["inputs: 'QHea_in' is in kW, its column 'QHea' in W; expected one unit"],
        ),
        (
            'column = "QHea"\ninterpolation = "previous"',
            'column = "QHea"',
            ["'QHea_in' has interpolation 'linear'; its column 'QHea' is the mean over a step: expected 'previous'"],
        ),
        ("noise.sensor", "noise.none", ["noise.none is set; expected another name: 'none' is no noise"]),
        ("value = 420.0", "value = 0.00042", ["inputs 'CO2Out': value is 0.00042 ppm", "is it in a fraction?"]),
    ],
)
def test_each_mistake_is_one_sentence(old, new, words):
    text = TOML.read_text()
    assert old in text
    with pytest.raises(SystemDescriptionError) as caught:
        parse_system(text.replace(old, new, 1), Path("mine.toml"))
    message = str(caught.value)
    assert message.startswith("mine.toml: ")
    assert "\n" not in message
    for word in words:
        assert word in message


def test_a_missing_file_and_an_fmu_in_the_place_of_its_description_are_named(tmp_path):
    with pytest.raises(SystemDescriptionError, match="no such file"):
        load_system(tmp_path / "nowhere.toml")
    fmu = ROOT / "fmus" / "MixedAirCO2.fmu"
    with pytest.raises(SystemDescriptionError, match=r"MixedAirCO2\.fmu: is an FMU or .* \(TOML\) that names it"):
        load_system(fmu)


def test_a_table_of_a_name_that_is_nearly_right_is_told_and_not_that_the_right_one_is_missing():
    text = TOML.read_text().replace("[[parameters]]", "[[parameter]]")
    with pytest.raises(SystemDescriptionError, match=r"^mine.toml: parameter: unknown .*; did you mean parameters\?"):
        parse_system(text, Path("mine.toml"))


# one name of each kind in the default room, and what takes its place
KINDS = {
    "parameters": ('name = "roo.V"', 'name = "{}"'),
    "inputs": ('name = "nPer"', 'name = "{}"'),
    "outputs": ('name = "CO2"', 'name = "{}"\nvariable = "CO2"'),
    "uncertain": ('name = "floor.capacity"', 'name = "{}"'),
}


@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize("name", ["time", "room/V"])
def test_no_variable_takes_the_place_of_a_field_of_a_shard(kind, name):
    old, new = KINDS[kind]
    text = TOML.read_text()
    assert old in text
    with pytest.raises(SystemDescriptionError) as caught:
        parse_system(text.replace(old, new.format(name), 1), Path("mine.toml"))
    assert f"{kind}: {name!r} is " in str(caught.value)
    assert ("variable =" in str(caught.value)) == (kind == "outputs")


def test_hash_is_of_what_is_simulated():
    text = TOML.read_text()
    system = parse_system(text, Path("a.toml"))
    assert parse_system("# a remark\n" + text, Path("b/c.toml")).hash() == system.hash()
    assert parse_system(text.replace("hours = 8760.0", "hours = 24.0"), Path("a.toml")).hash() == system.hash()
    assert parse_system(text.replace("max = 200.0", "max = 201.0"), Path("a.toml")).hash() != system.hash()
    assert system_from_canonical(system.canonical(), Path("a.toml")) == system


def test_noise_adds_floor_sensor_and_quantisation():
    system = load_system(TOML)
    output = system.outputs[0]
    sensor = output.noise["sensor"]
    expected = (output.accuracy**2 + sensor.sd**2 + sensor.quantum**2 / 12) ** 0.5
    assert system.noise_sd("sensor")[0] == pytest.approx(expected, rel=1e-12)
    assert system.noise_sd("none").tolist() == [o.accuracy for o in system.outputs]
    with pytest.raises(SystemDescriptionError, match="'loud' is not a preset"):
        system.noise_sd("loud")


@given(
    low=st.floats(1e-9, 1e6),
    factor=st.floats(1.001, 1e3),
    scale=st.sampled_from(["linear", "log"]),
    u=st.lists(st.floats(0, 1), min_size=2, max_size=5),
)
def test_prior_stays_in_range_and_is_monotone(low, factor, scale, u):
    parameter = Parameter(name="p", unit="1", min=low, max=low * factor, scale=scale)
    values = parameter.from_unit(np.sort(u))
    assert np.all(values >= parameter.min * (1 - 1e-12))
    assert np.all(values <= parameter.max * (1 + 1e-12))
    assert np.all(np.diff(values) >= -1e-12 * parameter.max)


SYSTEM = load_system(TOML)


@given(steps=st.integers(1, 60 * 24 * 366), step=st.sampled_from([1.0, 10.0, 60.0, 300.0, 420.0, 600.0, 900.0, 3600.0]))
@example(steps=385, step=300.0)
def test_whole_steps_divide_their_length_and_others_do_not(steps, step):
    """Lengths of recordings in hours are rounded: 385 steps of 300 s are 32.08333 h."""
    assert SYSTEM.with_experiment(step=step, hours=steps * step / 3600.0).experiment.step == step
    with pytest.raises(SystemDescriptionError, match=f"step {step:g} s does not divide"):
        SYSTEM.with_experiment(step=step, hours=(steps + 0.01) * step / 3600.0)
