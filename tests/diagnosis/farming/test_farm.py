"""A farm of recordings: resumed, extended, and what is refused."""

import json
from concurrent.futures import ThreadPoolExecutor
from contextlib import contextmanager
from dataclasses import asdict, replace

import numpy as np
import pytest

from diagnosis.cli import app
from diagnosis.farming import farm as farming
from diagnosis.farming.farm import farm
from diagnosis.verdicts import FILE_NAME, read_verdicts
from shared.console import OK, PARTLY, start
from shared.errors import RecordingError, SimulationError
from tests.diagnosis.farming.test_calibration import rows

MADE = rows(170, seed=11)


class Client:
    """Workers that are threads of this process."""

    def scheduler_info(self, n_workers):
        return {"workers": {"one": None}}

    def get_executor(self, pure):
        return ThreadPoolExecutor(1)


@pytest.fixture
def threads(monkeypatch):
    """Workers are threads: processes have tests of their own, and take long to start."""

    @contextmanager
    def connect(**places):
        yield Client()

    monkeypatch.setattr(farming, "connect", connect)


@pytest.fixture
def numbers(threads, monkeypatch):
    """Numbers of the recordings that were made; the last one of ten fails at first."""
    asked = []

    def work(made_by, seed, index):
        asked.append(index)
        if index == 9 and asked.count(9) == 1:
            raise SimulationError("it is stiff")
        return asdict(replace(MADE[index], index=index))

    monkeypatch.setattr(farming, "work", work)
    return asked


def test_what_is_there_is_not_made_again_and_what_failed_is(numbers, tmp_path):
    told = []
    first = farm(
        "MixedAirCO2", tmp_path, recordings=10, seed=7, progress=lambda done, total: told.append((done, total))
    )
    assert sorted(numbers) == [*range(10)]
    assert (first.verdicts, list(first.failed), told[-1]) == (None, [9], (10, 10))
    assert "ask for more --recordings" in first.lacking
    assert "it is stiff" in first.failed[9]
    assert not (tmp_path / FILE_NAME).exists()
    numbers[:] = [9]
    more = farm("MixedAirCO2", tmp_path, recordings=170)
    assert sorted(numbers[1:]) == [*range(9, 170)]
    assert [row.index for row in more.made.rows] == [*range(170)]
    assert more.made.rows == tuple(replace(row, index=k) for k, row in enumerate(MADE))
    assert read_verdicts(tmp_path / FILE_NAME) == more.verdicts
    assert more.verdicts.seed == 7
    table = more.to_dataframe()
    assert len(table) == 170 and "no_gap" in set(table["verdict"])
    assert "170 recordings of MixedAirCO2" in more.headline


@pytest.mark.parametrize(
    ("settings", "words"),
    [
        ({"seed": 8}, "seed is 7; expected 8"),
        ({"hours": 72.0}, "hours is 168.0; expected 72.0"),
        ({"noise": "loud"}, "expected a preset"),
        ({"hours": 3.0}, "expected at least 24"),
        ({"recordings": 0}, "expected at least 1"),
    ],
)
def test_rows_of_two_kinds_are_not_mixed_and_what_cannot_be_is_refused(numbers, tmp_path, settings, words):
    farm("MixedAirCO2", tmp_path, recordings=2, seed=7)
    with pytest.raises(RecordingError, match=words):
        farm("MixedAirCO2", tmp_path, **settings)
    assert sorted(numbers) == [0, 1]


def test_a_folder_that_was_begun_and_has_no_row_is_gone_on_with(numbers, tmp_path):
    """Killed between its first two steps; and a farm in which all fails has a table without a row."""
    (tmp_path / "rows").mkdir()
    done = farm("MixedAirCO2", tmp_path, recordings=2, seed=7)
    assert sorted(numbers) == [0, 1] and len(done.to_dataframe()) == 2
    assert len(replace(done, made=replace(done.made, rows=())).to_dataframe()) == 0


def test_the_command_writes_the_verdict_and_says_what_it_is_worth(numbers, tmp_path, capsys):
    words = ["farm", "MixedAirCO2", "--out", str(tmp_path), "--seed", "7", "--quiet"]
    assert start(app, [*words, "--recordings", "20"]) == PARTLY
    assert "ask for more" in " ".join(capsys.readouterr().out.split())
    assert start(app, [*words, "--recordings", "170"]) == OK
    said = " ".join(capsys.readouterr().out.split())
    assert "recordings without a cause in which a gap is answered" in said and "verdict.json: put it beside" in said
    assert start(app, [*words, "--recordings", "170", "--json"]) == OK
    assert json.loads(capsys.readouterr().out) == json.loads((tmp_path / FILE_NAME).read_text(encoding="utf-8"))


def test_a_recording_is_made_and_diagnosed(threads, default_system, tmp_path):
    """One day of the default room, with few candidates and few parameters: all of them take minutes."""
    known = {one.name: float(one.from_unit(0.5)) for one in default_system.parameters[3:]}
    few = default_system.model_copy(
        update={
            "effects": default_system.effects[:2],
            "parameters": default_system.parameters[:3],
            "fixed": default_system.fixed | known,
            "uncertain": [],
        }
    )
    (row,) = farm(few, tmp_path, recordings=1, hours=24.0, seed=18).made.rows
    errors, sd = np.array(row.errors).T  # of an estimate that the recording told something of: within its spread
    assert errors.shape == (3,) and (sd < 1.0).all() and (np.abs(errors) < 4 * sd).all()
    assert row.simulations > 100 and {*row.evidence.candidates} == {one.name for one in few.effects}


def test_rows_of_another_version_are_refused_before_more_are_made(numbers, tmp_path):
    farm("MixedAirCO2", tmp_path, recordings=2, seed=7)
    path = tmp_path / "rows" / "1.json"
    raw = json.loads(path.read_text())
    del raw["evidence"]["strained"]
    path.write_text(json.dumps(raw))
    with pytest.raises(RecordingError, match=r"row 1 is of another version of `diagnosis farm`.*give another --out"):
        farm("MixedAirCO2", tmp_path, recordings=4)
    assert numbers == [0, 1]
