"""The progress bar: on a terminal, and what takes its place without one."""

import io
import logging

import pytest
from rich.console import Console

import shared.progress
from shared.progress import progress_bar


@pytest.fixture
def screen(monkeypatch):
    """Standard error as a terminal, or not; returns what was written to it."""

    def made(terminal):
        console = Console(file=io.StringIO(), force_terminal=terminal, width=120)
        monkeypatch.setattr(shared.progress, "errors", console)
        monkeypatch.setattr(shared.progress, "EVERY", -1.0)
        return console.file

    return made


def work(shown):
    with progress_bar("simulating", 4, done=1, shown=shown) as bar:
        bar.update(2, note="3 a second")
        bar.update(4, count="all")


def test_a_terminal_gets_a_bar_and_the_log_the_same_figures(screen, caplog):
    written = screen(True)
    with caplog.at_level(logging.DEBUG, logger="zeroshot"):
        work(True)
    assert "simulating" in written.getvalue() and "3 a second" in written.getvalue() and "all" in written.getvalue()
    assert {record.levelno for record in caplog.records} == {logging.DEBUG}
    assert [record.getMessage() for record in caplog.records][1:] == [
        "simulating: 2 of 4, 3 a second",
        "simulating: all, 3 a second",
    ]
    assert (caplog.records[1].fields["done"], caplog.records[1].fields["total"]) == (2, 4)


@pytest.mark.parametrize(("shown", "level"), [(True, logging.INFO), (False, logging.DEBUG)])
def test_without_a_terminal_there_are_lines_for_those_who_want_them(screen, caplog, shown, level):
    written = screen(False)
    with caplog.at_level(logging.DEBUG, logger="zeroshot"):
        work(shown)
    assert written.getvalue() == ""
    assert {record.levelno for record in caplog.records} == {level}
