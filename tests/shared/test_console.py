"""How the command lines end: exit codes, sentences, and how to go on after a stop."""

import importlib
import json
import os
import signal
from typing import Annotated

import pytest
from cyclopts import Parameter
from rich.table import Table

from shared.console import ENDED, FAULT, OK, PARTLY, STOPPED, USAGE, new_app, new_console, resumable, start
from shared.errors import DatasetError, IncompleteError
from shared.logs import USUAL, Reporting

app = new_app("farm", "For tests.")
AS = {"fault": DatasetError("d: broken"), "partly": IncompleteError("1 of 9 failed"), "stop": KeyboardInterrupt()}


@app.command
@resumable("--resume", instead_of=["--overwrite"])
def fit(
    dataset: str,
    /,
    *,
    overwrite: Annotated[bool, Parameter(negative=())] = False,
    resume: Annotated[bool, Parameter(negative=())] = False,
    report: Reporting = USUAL,
):
    raise KeyboardInterrupt


@app.command
def do(what: str, *, report: Reporting = USUAL):
    if what == "code":
        return 3
    if what == "sigterm":
        os.kill(os.getpid(), signal.SIGTERM)
    if what == "torch":
        importlib.import_module("torchlike.nn")
    if what == "own":
        importlib.import_module("datagen.no_such_module")
    if what == "bug":
        raise ValueError("ours")
    if what == "full":
        with open("/dev/full", "w") as disk:
            disk.write("x")
    if what == "folder":
        open("/dev").close()
    if what in AS:
        raise AS[what]


@pytest.mark.parametrize(
    ("what", "code", "sentence"),
    [
        ("nothing", OK, ""),
        ("code", PARTLY, ""),
        ("fault", FAULT, "error: d: broken\n"),
        ("full", FAULT, "error: a file: cannot be read or written: No space left on device\n"),
        ("folder", FAULT, "error: /dev: cannot be read or written: Is a directory\n"),
        ("partly", PARTLY, "error: 1 of 9 failed\n"),
        ("stop", STOPPED, "warning: stopped before its end; the same command starts from the beginning\n"),
        ("sigterm", ENDED, "warning: stopped before its end; the same command starts from the beginning\n"),
        (
            "torch",
            FAULT,
            "error: farm needs torchlike, which is not installed; what it needs comes with: "
            "pip install 'zeroshot-fmu[farm]'\n",
        ),
    ],
)
def test_exit_codes_and_their_sentences(capsys, tmp_path, what, code, sentence):
    path = tmp_path / "log.jsonl"
    assert start(app, ["do", what, "--log", str(path), "--quiet"]) == code
    assert capsys.readouterr() == ("", sentence)
    lines = [json.loads(line) for line in path.read_text().splitlines()]
    assert lines[0]["message"].startswith(f"farm do {what} --log ")
    assert lines[0]["pid"] == os.getpid()
    assert lines[-1]["code"] == code and lines[-1]["seconds"] >= 0


def test_the_codes_are_those_of_the_documentation():
    assert (OK, FAULT, USAGE, PARTLY, STOPPED, ENDED) == (0, 1, 2, 3, 128 + signal.SIGINT, 128 + signal.SIGTERM)


@pytest.mark.parametrize("words", [["do"], ["done"], ["do", "nothing", "--loud"], ["do", "x", "--quiet", "--verbose"]])
def test_wrong_usage(capsys, words):
    assert start(app, words) == USAGE
    assert capsys.readouterr().err


@pytest.mark.parametrize(("what", "kind"), [("bug", ValueError), ("own", ModuleNotFoundError)])
def test_a_bug_of_ours_is_not_hidden_and_is_in_the_log(tmp_path, what, kind):
    path = tmp_path / "log.jsonl"
    with pytest.raises(kind):
        start(app, ["do", what, "--log", str(path)])
    found = [json.loads(line) for line in path.read_text().splitlines()]
    assert kind.__name__ in found[1]["traceback"]
    assert found[-1]["code"] == FAULT


@pytest.mark.parametrize(
    ("words", "again"),
    [
        (["my set"], "farm fit 'my set' --resume"),
        (["set", "--overwrite"], "farm fit set --resume"),
        (["set", "--resume", "--quiet"], "farm fit set --resume --quiet"),
    ],
)
def test_a_stop_tells_how_to_go_on(capsys, words, again):
    assert start(app, ["fit", *words]) == STOPPED
    said = capsys.readouterr().err.splitlines()
    assert said == ["warning: stopped; finished work is kept, and this command continues it:", f"  {again}"]


def test_no_command_and_help_are_no_mistake(capsys):
    assert start(app, []) == OK
    assert start(app, ["do", "--help"]) == OK
    said = capsys.readouterr().out
    assert "--quiet" in said and "--verbose" in said and "--log" in said


def test_units_in_brackets_are_printed_as_they_stand(capsys):
    table = Table("room [degC]", "[h]", box=None, title="of [/min]")
    table.add_row("gas [/min]", "[bold]")
    new_console().print(table)
    said = capsys.readouterr().out
    assert all(text in said for text in ("room [degC]", "[h]", "of [/min]", "gas [/min]", "[bold]"))
