"""Logs: what is said at which verbosity, and what the file holds."""

import io
import json
import math
import warnings

import numpy as np
import pytest
from rich.console import Console

from shared.errors import ZeroshotError
from shared.logs import Reporting, fields, logger, reported

log = logger("tests.module")


@pytest.fixture
def console():
    return Console(file=io.StringIO(), soft_wrap=True)


def say_all():
    log.debug("step %d", 3, extra=fields(step=3))
    log.info("2 workers")
    log.warning("one failed [red]")
    log.error("no more")


@pytest.mark.parametrize(
    ("options", "said"),
    [
        (Reporting(), ["2 workers", "warning: one failed [red]", "error: no more"]),
        (Reporting(quiet=True), ["warning: one failed [red]", "error: no more"]),
        (Reporting(verbose=True), ["step 3", "2 workers", "warning: one failed [red]", "error: no more"]),
    ],
)
def test_what_is_said_at_which_verbosity(console, options, said):
    with reported(options, console):
        say_all()
    say_all()  # nobody hears it any more
    assert console.file.getvalue().splitlines() == said


def test_the_file_holds_every_step_of_a_quiet_command(console, tmp_path):
    path = tmp_path / "log.jsonl"
    with reported(Reporting(log=path, quiet=True), console):
        say_all()
    lines = [json.loads(line) for line in path.read_text().splitlines()]
    assert [(one["level"], one["message"]) for one in lines] == [
        ("debug", "step 3"),
        ("info", "2 workers"),
        ("warning", "one failed [red]"),
        ("error", "no more"),
    ]
    assert lines[0]["step"] == 3
    assert {one["logger"] for one in lines} == {"tests.module"}
    assert all(one["time"].endswith("+00:00") for one in lines)


def test_what_is_not_a_finite_number_is_null_as_any_reader_of_json_expects(console, tmp_path):
    path = tmp_path / "log.jsonl"
    figures = {"loss": math.nan, "rows": [1.5, (np.float32("nan"), -math.inf)], "best": {"value": np.float64("inf")}}
    with reported(Reporting(log=path, quiet=True), console):
        log.debug("one", extra=fields(**figures, steps=10**400, done=True))

    def refuse(word):
        raise AssertionError(f"{word} is no JSON")

    found = json.loads(path.read_text(), parse_constant=refuse)
    assert (found["loss"], found["rows"], found["best"]) == (None, [1.5, [None, None]], {"value": None})
    assert (found["steps"], found["done"]) == (10**400, True)


def test_a_log_that_cannot_be_written_is_refused(console, tmp_path):
    with (
        pytest.raises(ZeroshotError, match=r"there/log.jsonl: no log can be written there: No such file"),
        reported(Reporting(log=tmp_path / "there" / "log.jsonl"), console),
    ):
        pass


def test_warnings_of_libraries_are_for_the_log_and_not_for_the_terminal(console, tmp_path, capsys):
    path, before = tmp_path / "log.jsonl", warnings.showwarning
    with reported(Reporting(log=path), console), warnings.catch_warnings():
        warnings.simplefilter("always")
        np.array([1e308]) * 10
    assert console.file.getvalue() == capsys.readouterr().err == ""
    assert "RuntimeWarning: overflow" in json.loads(path.read_text())["message"]
    assert warnings.showwarning is before
