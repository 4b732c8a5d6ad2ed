"""FMUs that misbehave: an error that says so, never short data; and those that do not reset cleanly are found out."""

import threading
import time
import zipfile

import fmpy
import numpy as np
import pytest

from datagen.driving.tables import merge
from datagen.fmi.fmu import Fmu
from datagen.simulating.canary import resets_cleanly
from datagen.simulating.simulator import Simulator
from shared.errors import FmuError, SimulationError
from tests.datagen.fmus import rewritten

FLAVOURS = [(2, "me"), (3, "cs")]
"""Both versions and both kinds; test_any_fmu.py has all four."""
FAULTS = [
    *("none", "ends", "fails", "hangs", "not_a_number", "discards", "returns_early", "never_settles"),
    *("dirty", "slow", "crashes", "leaks", "mutters", "chatters"),
]
"""In the order of ``tests/fmus/small/faulty.c``."""


@pytest.fixture(params=FLAVOURS, ids=["fmi2-me", "fmi3-cs"])
def flavour(request):
    return request.param


def faulty(small_system, flavour, **options):
    version, kind = flavour
    return Simulator(small_system("faulty", version, (kind,), outputs={"x": "point"}, parameters=("k",), **options))


def run(simulator, fault, when=2.0, stop=5.0, **options):
    values = {"k": 1.0, "fault": float(FAULTS.index(fault)), "when": when}
    return simulator.run(values, merge({}, 0.0, stop), start=0.0, stop=stop, **options)


ERRORS = [
    ("ends", ["me", "cs"], "asked to terminate"),
    ("fails", ["me"], r"fmi\dGet\w*Derivatives returned status 3"),
    ("fails", ["cs"], r"fmi\dDoStep returned status 3"),
    ("discards", ["me"], r"returned status 2|too many steps|corrector"),
    ("discards", ["cs"], r"DoStep returned status 2"),
    ("not_a_number", ["me", "cs"], "CVODE|not finite"),
    ("never_settles", ["me"], "events without end"),
    ("returns_early", ["cs3"], "returned early"),
]


@pytest.mark.parametrize(
    ("flavour", "fault", "words"),
    [(f, fault, words) for fault, kinds, words in ERRORS for f in FLAVOURS if {f[1], f"{f[1]}{f[0]}"} & set(kinds)],
)
def test_each_fault_is_an_error(small_system, flavour, fault, words):
    simulator = faulty(small_system, flavour)
    with pytest.raises(SimulationError, match=words) as caught:
        run(simulator, fault)
    assert "faulty" in str(caught.value)
    assert "of 5 s" in str(caught.value)
    # the next run is clean
    good = run(simulator, "none")
    np.testing.assert_allclose(good.outputs[0], np.exp(-good.time), rtol=1e-6 if flavour[1] == "me" else 0.05)


def test_an_error_is_quoted_and_no_warning_before_or_after_it(small_system, flavour):
    with pytest.raises(SimulationError, match=r'the FMU says: "k > 1" \| the valve is stuck at t = [\d.]*$'):
        run(faulty(small_system, flavour), "chatters")


def test_a_timeout_ends_a_slow_simulation(small_system, flavour):
    simulator = faulty(small_system, flavour)
    run(simulator, "slow", when=1e9)
    began = time.perf_counter()
    with pytest.raises(SimulationError, match=r"timed out after 0\.3 s"):
        run(simulator, "slow", when=0.0, stop=1000.0, timeout=0.3)
    assert time.perf_counter() - began < 1.5
    assert run(simulator, "none", timeout=60.0).outputs.shape == (1, 40)
    assert not [t for t in threading.enumerate() if isinstance(t, threading.Timer) and t.is_alive() and t.interval > 1]


def test_a_span_that_is_no_whole_number_of_steps_is_refused(small_system, flavour):
    simulator = faulty(small_system, flavour)
    with pytest.raises(ValueError, match="whole number of steps"):
        run(simulator, "none", stop=1.6, step=1.0)
    # rounding is not a reason, and the last row is there
    assert np.isfinite(run(simulator, "none", stop=0.7, step=0.1).outputs).all()


def test_the_canary_finds_what_does_not_reset(small_system, flavour):
    simulator = faulty(small_system, flavour)
    table = merge({}, 0.0, 5.0)
    for fault, clean in (("none", True), ("dirty", False)):
        values = {"k": 1.0, "fault": float(FAULTS.index(fault)), "when": 0.0}
        assert resets_cleanly(simulator, values, table, start=0.0, stop=5.0, step=0.125) is clean


def test_a_missing_resource_stops_the_instantiation(small_system, flavour):
    version, kind = flavour
    system = small_system("resource", version, (kind,), outputs={"y": "point"}, parameters=("gain",), number="none")
    with pytest.raises(FmuError, match=r"cannot be instantiated.*cannot load its resources"):
        Simulator(system).run({"gain": 1.0}, merge({}, 0.0, 1.0), start=0.0, stop=1.0)


def test_an_fmu_without_a_binary_for_this_machine(small_fmu, tmp_path):
    """What there is instead is said, and where a binary is expected."""
    tuples = f"binaries/{fmpy.platform_tuple}/"
    for there, found, cure in (
        ((), "no binaries", "export it"),
        (("sources/a.c",), "sources only", "compile its sources"),
        (("binaries/beos/a.so", "binaries/amiga/a.so"), "binaries for amiga, beos", "export it"),
        (("binaries/beos/a.so", "sources/a.c"), "binaries for beos, and sources", "compile its sources"),
    ):
        with zipfile.ZipFile(small_fmu("lag", 3)) as source, zipfile.ZipFile(tmp_path / "bare.fmu", "w") as target:
            target.writestr("modelDescription.xml", source.read("modelDescription.xml"))
            for name in there:
                target.writestr(name, "")
        with pytest.raises(FmuError, match=rf"no usable binary .*: found {found}; expected .*{tuples}.*: {cure}"):
            Fmu(tmp_path / "bare.fmu")


def test_scheduled_execution_is_refused(small_fmu, tmp_path):
    clocked = rewritten(small_fmu("lag", 3), tmp_path / "clocked.fmu", ("<ModelExchange", "<ScheduledExecution"))
    with pytest.raises(FmuError, match=r"FMI 3\.0 without Model Exchange or Co-Simulation"):
        Fmu(clocked)
