"""What all commands of the three programs have in common."""

import json
import re
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest

from datagen.cli import app as datagen
from diagnosis.cli import app as diagnosis
from shared.console import STOPPED, USAGE, start
from shared.logs import Reporting
from tests.trainer.conftest import make_dataset
from trainer.cli import app as trainer

PROGRAMS = {"datagen": datagen, "trainer": trainer, "diagnosis": diagnosis}
SHORT = {
    *("datagen describe", "datagen simulate", "datagen info", "datagen merge"),
    *("trainer evaluate", "trainer calibration", "trainer predict", "trainer info"),
    *("diagnosis app", "diagnosis residuals", "diagnosis import", "diagnosis blind score"),
}
"""Commands that are done before anybody asks how far they are, and the page, which shows that itself."""
RUNNING = (Path(__file__).parents[1] / "docs" / "running.md").read_text()


def commands(app, before):
    for name in app:
        if not name.startswith("-"):
            inner = app[name]
            if inner.default_command is None:
                yield from commands(inner, f"{before} {name}")
            else:
                yield f"{before} {name}", inner


EVERY = dict(pair for name, app in PROGRAMS.items() for pair in commands(app, name))


def long_ones():
    return {
        name
        for name, app in EVERY.items()
        if any(
            one.field_info.annotation is Reporting or "--log" in one.names for one in app.assemble_argument_collection()
        )
    }


def test_every_long_command_reports_in_the_same_way():
    assert long_ones() == set(EVERY) - SHORT
    assert set(EVERY) > SHORT
    for name in long_ones():
        flags = {flag for one in EVERY[name].assemble_argument_collection() for flag in one.names}
        assert {"--quiet", "--verbose", "--log"} <= flags, name


def test_the_page_on_long_runs_names_every_long_command_and_how_it_goes_on():
    rows = dict(re.findall(r"^\| `((?:datagen|trainer|diagnosis) [a-z ]+)` \| (.*) \|$", RUNNING, re.MULTILINE))
    assert set(rows) == long_ones()
    from shared.console import _resumable

    for name, how in rows.items():
        command = EVERY[name].default_command
        assert ("starts from the beginning" in how) == (command not in _resumable), name
        for option in _resumable.get(command, ((), ()))[0]:
            assert f"`{option}`" in how, name


CHILD = """
import sys, trainer.training.loop
from trainer.cli import main
trainer.training.loop.SAVE_SECONDS = 0.1
main(sys.argv[1:])
"""


@pytest.mark.slow
def test_a_training_that_is_stopped_says_how_to_go_on_and_that_goes_on(tmp_path, capsys):
    """To the same weights as one that was not stopped: trainer/training/test_resuming.py."""
    tanks = make_dataset(tmp_path / "tanks", systems=20)
    options = {"width": 16, "layers": 1, "heads": 2, "feedforward": 32}
    words = ["fit", tanks, "--out", tmp_path / "run", "--context", "12", "--steps", "250", "--log", tmp_path / "log"]
    words += [word for name, value in options.items() for word in (f"--option.{name}", value)]
    child = subprocess.Popen(
        [sys.executable, "-c", CHILD, *map(str, words)],
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
        preexec_fn=lambda: signal.signal(signal.SIGINT, signal.SIG_DFL),
    )
    for _ in range(3000):
        if (tmp_path / "run" / "state.safetensors").exists():
            break
        assert child.poll() is None, child.communicate()
        time.sleep(0.02)
    child.send_signal(signal.SIGINT)
    out, err = child.communicate(timeout=60)
    assert (child.returncode, out) == (STOPPED, "")
    assert "Traceback" not in err
    sentence, again = err.splitlines()[-2:]
    assert sentence == "warning: stopped; finished work is kept, and this command continues it:"
    program, *rest = again.split()
    assert program == "trainer" and rest == [*map(str, words), "--resume"]
    assert start(trainer, rest) == 0
    assert capsys.readouterr().out == ""
    lines = [json.loads(line) for line in (tmp_path / "log").read_text().splitlines()]
    assert [line["code"] for line in lines if "code" in line] == [STOPPED, 0]
    steps = [line["step"] for line in lines if "validation_loss" in line and "step" in line]
    assert sorted(set(steps)) == [*range(6, 250, 6), 250] and steps[-1] == 250
    assert len(steps) <= len(set(steps)) + 1  # what was scored but not yet saved is done twice
    assert not (tmp_path / "run" / "state.safetensors").exists()


@pytest.mark.parametrize(
    "line",
    [
        "datagen simulate MixedAirCO2 --out one.nc --seed -1",
        "datagen identifiability MixedAirCO2 --systems 0",
        "datagen compare MixedAirCO2 MixedAirCO2 --out nearness --seed -1",
        "diagnosis run MixedAirCO2 one.nc --out answer --seed -1",
        "diagnosis calibrate MixedAirCO2 one.nc --out answer --seed -1",
        "diagnosis blind make blind --seed -1",
        "diagnosis blind run MixedAirCO2 blind --out verdicts --seed -1",
    ],
)
def test_numbers_that_make_no_sense_are_wrong_usage(capsys, line):
    program, *words = line.split()
    assert start(PROGRAMS[program], words) == USAGE
    said = capsys.readouterr().err
    option = next(word for word in reversed(words) if word.startswith("--"))
    assert "Invalid value" in said
    assert option in said
