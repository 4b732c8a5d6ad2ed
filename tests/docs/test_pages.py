"""The quick commands of the pages do what the pages say, in the order in which they stand there."""

import re
import shlex
from itertools import pairwise
from pathlib import Path

import numpy as np
import pytest
import xarray as xr

import datagen
from datagen.cli import app as datagen_app
from diagnosis.blind.truth import load_truth
from diagnosis.cli import app as diagnosis_app
from shared.console import start
from shared.system import load_system
from tests.datagen.faults import stay_in_this_process
from trainer.cli import app as trainer_app

ROOT = Path(__file__).resolve().parents[2]
APPS = {"datagen": datagen_app, "trainer": trainer_app, "diagnosis": diagnosis_app}
LONG = {("diagnosis", "run"), ("diagnosis", "calibrate"), ("diagnosis", "forecast")}
"""Commands of a minute and more; other tests run them on smaller things."""

FEWER = {"200": "60", "40": "15"}
"""Rooms in the place of as many as a page asks for: still some in each split, and no page shows what comes of them."""


def commands(page):
    """The commands of a page, one by one."""
    for block in re.findall(r"```sh\n(.*?)```", (ROOT / "docs" / page).read_text(encoding="utf-8"), re.DOTALL):
        for line in block.replace("\\\n", " ").splitlines():
            words = shlex.split(line, comments=True)
            if words and words[0] in APPS and tuple(words[:2]) not in LONG:
                yield words


def run(page, folder, monkeypatch):
    """Run a page's quick commands in a folder, farms here and of fewer rooms; returns how many there were."""
    stay_in_this_process(monkeypatch)
    monkeypatch.chdir(folder)
    if not (folder / "docs").exists():
        (folder / "docs").symlink_to(ROOT / "docs")
    count = 0
    for words in commands(page):
        words = [FEWER.get(word, word) if before == "--systems" else word for before, word in pairwise(["", *words])]
        assert start(APPS[words[0]], words[1:]) == 0, shlex.join(words)
        count += 1
    return count


@pytest.mark.slow
def test_the_session(tmp_path, monkeypatch, capsys):
    assert run("session.md", tmp_path, monkeypatch) == 8
    said = capsys.readouterr().out
    assert "every shard is as the manifest says" in said
    assert (tmp_path / "data" / "README.md").is_file()
    odd, plain = xr.load_dataset(tmp_path / "odd.nc"), xr.load_dataset(tmp_path / "room.nc")
    # 400 W more in the same room: warmer, on the days that both have
    assert float((odd["TRoo"][:336] - plain["TRoo"]).mean()) > 0.1


@pytest.mark.slow
def test_sharing(tmp_path, monkeypatch, capsys):
    assert run("share.md", tmp_path, monkeypatch) == 7
    both = xr.concat([xr.load_dataset(one) for one in sorted((tmp_path / "both" / "shards").glob("*.nc"))], "system")
    assert both.sizes["system"] == 30


@pytest.mark.slow
def test_the_measurements_of_the_example_come_back_as_they_were(tmp_path, monkeypatch, capsys):
    """The log is of a simulated room: what is imported is that room, within what its sensors and the log round away."""
    assert run("own-measurements.md", tmp_path, monkeypatch) == 4
    found = xr.load_dataset(tmp_path / "recording.nc", decode_times=False)
    room = datagen.simulate("MixedAirCO2", seed=12, hours=504, excitation=False)
    room = room.sel(time=found["time"].values)
    for name, sd, rounded in (("TRoo", 0.1, 0.1), ("CO2", 20.0, 1.0), ("QHea", 100.0, 10.0), ("mOA", 0.01, 0.001)):
        error = (found[name] - room[name]).values
        error = error[np.isfinite(error)]
        assert np.sqrt(np.mean(error**2)) == pytest.approx(np.hypot(sd, rounded / 12**0.5), rel=0.2), name
        assert abs(error.mean()) < 5 * sd / np.sqrt(len(error)), name
    assert len(found["time"]) > 400
    assert (
        float(np.corrcoef(found["HFac"], room["HFac"])[0, 1]) > 0.9
    )  # split and transposed again, from the horizontal
    np.testing.assert_allclose(found["TDryBul"], room["TDryBul"], atol=0.06)
    assert "assumed" in capsys.readouterr().out


def test_the_log_of_the_example_is_what_its_script_makes():
    import importlib.util

    import pandas as pd

    spec = importlib.util.spec_from_file_location("example_measurements", ROOT / "docs/making/measurements.py")
    script = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(script)
    kept = pd.read_csv(ROOT / "docs/example/measurements.csv")
    made = script.measurements()
    assert list(kept["time"]) == list(made["time"])
    for name in kept.columns[1:]:
        # another platform's rounding may move a reading by one digit of its sensor
        np.testing.assert_allclose(kept[name], made[name], atol=1.01 * np.diff(np.unique(kept[name].dropna())).min())


def test_the_truth_of_a_blind_check_of_one_s_own_is_one_of_the_house(tmp_path):
    """What the page has one write is read, for the description that the page begins with."""
    blocks = re.findall(r"```toml\n(.*?)```", (ROOT / "docs/own-fmu.md").read_text(encoding="utf-8"), re.DOTALL)
    (text,) = [one for one in blocks if "[[forms]]" in one]
    (tmp_path / "truth.toml").write_text(text, encoding="utf-8")
    truth = load_truth(tmp_path / "truth.toml", load_system(ROOT / "docs/gallery/house"))
    assert [form.name for form in truth.outside] == ["guests"]
    assert len(truth.strata.order) == 6
