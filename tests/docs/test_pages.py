"""The quick commands of the pages do what the pages say, in the order in which they stand there."""

import json
import re
import shlex
import shutil

import numpy as np
import pandas as pd
import pytest
import xarray as xr

import datagen
from datagen.cli import app as datagen_app
from diagnosis.blind.truth import load_truth
from diagnosis.cli import app as diagnosis_app
from shared.console import start
from shared.system import load_system
from tests.datagen.faults import stay_in_this_process
from tests.docs.documented import ROOMS, ROOT, in_blocks, runs_here, script, smaller
from trainer.cli import app as trainer_app
from trainer.runs.checkpoint import load_run

APPS = {"datagen": datagen_app, "trainer": trainer_app, "diagnosis": diagnosis_app}


@pytest.fixture(scope="module")
def run(tmp_path_factory):
    """``run(page)``: run what a page has to run, in one folder for all pages; returns that, and how many there were.

    What was run before, with the same sizes, is not run again. The page on one's own FMU has a recording of that.
    """
    folder = tmp_path_factory.mktemp("pages")
    (folder / "docs").symlink_to(ROOT / "docs")
    shutil.copy(ROOT / "docs/example/measurements.csv", folder)
    shutil.copy(ROOT / "docs/example/mapping.toml", folder)
    for name in ("mine", "other"):
        script("gallery/house").build_fmu(folder / name)
    datagen.simulate(folder / "mine", hours=168, out=folder / "own" / "recording.nc")
    (folder / "own" / "mine").symlink_to(folder / "mine")
    done = set()

    def run_page(page):
        here = folder / "own" if page == "docs/own-fmu.md" else folder
        count = 0
        with pytest.MonkeyPatch.context() as patch:
            stay_in_this_process(patch)
            patch.setattr("datagen.simulating.liveness.check_live_apart", lambda *_, **__: {})
            patch.chdir(here)
            for words in in_blocks((ROOT / page).read_text(encoding="utf-8")):
                less = smaller(words)
                if runs_here(ROOT / page, words) and tuple(less) not in done:
                    assert start(APPS[less[0]], less[1:]) == 0, shlex.join(less)
                    done.add(tuple(less))
                    count += 1
        return here, count

    return run_page


@pytest.mark.slow
def test_the_quick_start(run, capsys):
    folder, count = run("docs/quick-start.md")
    assert count == 8
    said = capsys.readouterr().out
    assert "every shard is as the manifest says" in said
    assert (folder / "data" / "README.md").is_file()
    odd, plain = xr.load_dataset(folder / "odd.nc"), xr.load_dataset(folder / "room.nc")
    # 400 W more in the same room: warmer, on the days that both have
    assert float((odd["TRoo"][:336] - plain["TRoo"]).mean()) > 0.1


@pytest.mark.slow
def test_sharing(run):
    folder, count = run("docs/share.md")
    assert count == 7
    both = xr.concat([xr.load_dataset(one) for one in sorted((folder / "both" / "shards").glob("*.nc"))], "system")
    assert both.sizes["system"] == 2 * ROOMS


@pytest.mark.slow
def test_an_fmu_of_one_s_own(run):
    folder, count = run("docs/own-fmu.md")
    assert count == 7
    assert {one.name for one in load_system(folder / "mine" / "draft.toml").inputs if one.source == "weather"}
    assert len(load_run(folder / "mine-run").card.encoding.parameters) == len(load_system(folder / "mine").parameters)


@pytest.mark.slow
def test_long_runs(run):
    folder, count = run("docs/running.md")
    assert count == 2
    keys = re.findall(r"(?m)^[|] `(\w+)` [|]", (ROOT / "docs/running.md").read_text(encoding="utf-8"))
    assert keys[:4] == ["time", "level", "logger", "message"]
    for line in (folder / "ridge.jsonl").read_text(encoding="utf-8").splitlines():
        assert {*keys[:4]} <= {*json.loads(line)}


@pytest.mark.slow
def test_the_measurements_of_the_example_come_back_as_they_were(run, capsys):
    """The log is of a simulated room: what is imported is that room, within what its sensors and the log round away."""
    folder, count = run("docs/own-measurements.md")
    assert count == 4
    found = xr.load_dataset(folder / "recording.nc", decode_times=False)
    room = datagen.simulate("MixedAirCO2", seed=12, hours=504, excitation=False)
    room = room.sel(time=found["time"].values)
    for name, sd, rounded in (("TRoo", 0.1, 0.1), ("CO2", 20.0, 1.0), ("QHea", 100.0, 10.0), ("mOA", 0.01, 0.001)):
        error = (found[name] - room[name]).values
        error = error[np.isfinite(error)]
        assert np.sqrt(np.mean(error**2)) == pytest.approx(np.hypot(sd, rounded / 12**0.5), rel=0.2), name
        assert abs(error.mean()) < 5 * sd / np.sqrt(len(error)), name
    assert len(found["time"]) > 400
    # split and transposed again, from the horizontal
    assert float(np.corrcoef(found["HFac"], room["HFac"])[0, 1]) > 0.9
    np.testing.assert_allclose(found["TDryBul"], room["TDryBul"], atol=0.06)
    assert "assumed" in capsys.readouterr().out


def test_the_log_of_the_example_is_what_its_script_makes():
    kept = pd.read_csv(ROOT / "docs/example/measurements.csv")
    made = script("making/measurements").measurements()
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


@pytest.mark.slow
def test_the_readme(run):
    """Of the pages before it there are a dataset, a recording and those of two teams."""
    for page in ("docs/quick-start.md", "docs/share.md", "docs/own-measurements.md"):
        run(page)
    _, count = run("README.md")
    assert count > 0
