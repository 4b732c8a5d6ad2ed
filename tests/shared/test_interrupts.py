"""Interrupts arrive, wherever the program is when they come."""

import os
import signal
import time

import pytest

from shared.interrupts import Terminated, terminable


class Dying:
    """Whose destructor is being run when a signal comes."""

    def __init__(self, number):
        self.number = number

    def __del__(self):
        os.kill(os.getpid(), self.number)
        time.sleep(0.01)


@pytest.fixture
def answered():
    """Ctrl-C interrupts, also where the tests were started in the background, which ignores it."""
    before = signal.signal(signal.SIGINT, signal.default_int_handler)
    yield
    signal.signal(signal.SIGINT, before)


@pytest.mark.skipif(os.name == "nt", reason="a signal that one sends to oneself ends a process there")
@pytest.mark.parametrize(("number", "kind"), [(signal.SIGTERM, Terminated), (signal.SIGINT, KeyboardInterrupt)])
def test_an_interrupt_that_python_drops_in_a_destructor_comes_again(number, kind, capfd, answered):
    one = Dying(number)
    began = time.monotonic()
    with pytest.raises(KeyboardInterrupt) as caught, terminable():
        del one
        time.sleep(10)
    assert type(caught.value) is kind
    assert time.monotonic() - began < 5
    assert capfd.readouterr().err == ""
