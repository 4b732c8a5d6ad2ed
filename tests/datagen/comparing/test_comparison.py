"""Comparisons of two FMUs."""

import subprocess
import sys
import zipfile
from pathlib import Path
from xml.etree import ElementTree

import numpy as np
import pandas as pd
import pytest

from datagen.comparing.comparison import Comparison, compare
from datagen.comparing.matching import inputs_for
from datagen.comparing.report import NUMBERS, PICTURE, TABLE, write_report
from datagen.driving.tables import InputTable
from shared.errors import SystemDescriptionError
from shared.system import parse_system

ROOT = Path(__file__).resolve().parents[3]
TOML = ROOT / "fmus" / "MixedAirCO2" / "system.toml"


@pytest.fixture(scope="module")
def finer(tmp_path_factory):
    """The default system with walls of nine nodes in place of three."""
    pytest.importorskip("ziglang")
    folder = tmp_path_factory.mktemp("finer")
    fmu = folder / "fine.fmu"
    command = [sys.executable, "fmus/build.py", "--nodes", "9", "--platforms", "native", "--out", str(fmu)]
    subprocess.run(command, cwd=ROOT, check=True, capture_output=True)
    return parse_system(TOML.read_text(encoding="utf-8").replace("../MixedAirCO2.fmu", fmu.name), folder / "fine.toml")


@pytest.mark.slow
def test_finer_walls_move_the_temperature_but_not_the_air(default, finer):
    found = compare(default, finer, systems=2, hours=336, seed=3)
    rows = {row.cell: row for row in found.rows()}
    temperature, co2, _, flow = rows["all"].rms
    # the walls are the only difference: the room feels it, the air exchange must not
    assert 0.005 < temperature < 0.15
    assert co2 < 0.02
    assert flow < 1e-4
    # a wall of three nodes stores as much heat as one of nine: no lasting bias
    assert abs(rows["all"].bias[0]) < 0.3 * temperature
    picked = found.differences[:, 0]
    assert rows["all"].rms[0] == pytest.approx(np.sqrt(np.mean(picked**2)))
    assert rows["1"].largest[0] == pytest.approx(np.abs(picked[1]).max())
    assert rows["nPer: occupied"].steps + rows["nPer: empty"].steps == picked.size


def test_what_does_not_fit_is_refused(default):
    parameters = [one for one in default.parameters if one.name != "roo.V"]
    with pytest.raises(SystemDescriptionError, match=r"has no parameter 'roo.V'"):
        compare(default, default.model_copy(update={"parameters": parameters}))
    inputs = [one.model_copy(update={"unit": "degC"}) if one.name == "TSky" else one for one in default.inputs]
    with pytest.raises(SystemDescriptionError, match="inputs 'TSky' has unit 'degC'; expected 'K'"):
        compare(default, default.model_copy(update={"inputs": inputs}))
    table = InputTable(
        ("TSky",), np.array([0.0, 1.0]), np.full((1, 1), 280.0), np.full((1, 1), 281.0), np.zeros(2, bool)
    )
    some = default.model_copy(update={"inputs": [one for one in default.inputs if one.name in ("CO2Out", "TSky")]})
    made = inputs_for(some, table)
    assert dict(zip(made.names, made.left[0], strict=True)) == {"TSky": 280.0, "CO2Out": 420.0}
    with pytest.raises(SystemDescriptionError, match="'TDryBul' comes from weather"):
        inputs_for(default, table)
    with pytest.raises(SystemDescriptionError, match="compared with nothing"):
        compare(default)


def test_what_only_one_has_is_told(default, tmp_path, caplog):
    """The second estimates one parameter more, which the FMU was made with at a value of its own."""
    fewer = [one for one in default.parameters if one.name != "roo.V"]
    first = default.model_copy(update={"parameters": fewer})
    with zipfile.ZipFile(default.fmu_path) as archive:
        tree = ElementTree.fromstring(archive.read("modelDescription.xml"))
    start = tree.find(".//ScalarVariable[@name='roo.V']/Real").get("start")
    with caplog.at_level("WARNING", "zeroshot"):
        found = compare(first, default, systems=1, hours=24)
    said = "parameters of MixedAirCO2.fmu that MixedAirCO2.fmu does not draw are held at its own values: "
    said += f"roo.V ({start} m3)"
    assert found.notes == (said,)
    assert said in caplog.text
    write_report(found, tmp_path)
    assert f"\n- {said}\n\n| |" in (tmp_path / TABLE).read_text()
    fixed = default.model_copy(update={"parameters": fewer, "fixed": {**default.fixed, "roo.V": float(start)}})
    assert np.array_equal(compare(fixed, fixed, systems=1, hours=24).first, found.second)


def test_what_the_first_holds_fixed_the_second_gets_too(default):
    """One FMU for both, so that equal values show as equal trajectories."""
    volume = next(one for one in default.parameters if one.name == "roo.V").max
    fewer = {"parameters": [one for one in default.parameters if one.name != "roo.V"]}
    ours = {**default.fixed, "roo.V": volume, "CO2_start": 1500.0}
    first = default.model_copy(update={**fewer, "fixed": ours})
    drawn = compare(first, default, systems=1, hours=24)  # the second would draw the volume, and leaves CO2_start
    assert np.array_equal(drawn.first, drawn.second)
    assert drawn.notes == ()
    otherwise = default.model_copy(update={**fewer, "fixed": {**ours, "CO2_start": 600.0}})
    found = compare(first, otherwise, systems=1, hours=24)
    said = "values under [fixed] of MixedAirCO2.fmu are not those of MixedAirCO2.fmu: CO2_start (600 in place of 1500)"
    assert found.notes == (said,)
    alone = compare(otherwise, otherwise, systems=1, hours=24)
    assert np.array_equal(found.second, alone.first)
    assert not np.array_equal(found.first, alone.first)


def test_report_holds_the_numbers_of_the_comparison(default, tmp_path):
    time = np.tile(3600.0 * np.arange(1, 25), (1, 1))
    first = np.zeros((1, 2, 24))
    second = first + np.array([3.0, -4.0])[None, :, None]
    mask = np.zeros((1, 24), dtype=bool)
    mask[0, :6] = True
    second[0, 0, :6] = 5.0
    made = Comparison(("a", "b"), default.outputs[:2], ["0"], time, first, second, {("regime", "night"): mask})
    write_report(made, tmp_path)
    table = pd.read_csv(tmp_path / NUMBERS).set_index(["cell", "output"])
    assert table.loc[("night", "TRoo"), "bias"] == 5.0
    assert table.loc[("night", "TRoo"), "steps"] == 6
    assert table.loc[("all", "TRoo"), "rms"] == pytest.approx(np.sqrt((6 * 25 + 18 * 9) / 24))
    assert table.loc[("all", "CO2"), "bias"] == -4.0
    assert "| regime | night | 6 | +5, 5, 5 | -4, 4, 4 |" in (tmp_path / TABLE).read_text()
    assert (tmp_path / PICTURE).read_bytes()[:4] == b"\x89PNG"
