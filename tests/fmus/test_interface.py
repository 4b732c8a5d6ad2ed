"""The FMI functions: life cycle, values, FMU states, refusals."""

import ctypes
import math

import numpy as np
import pytest
from fmpy.fmi1 import FMICallException

DAY = 86400.0
HOURS = np.arange(0.0, DAY + 1, 3600.0)
OUTPUTS = ("TRoo", "CO2", "QHea", "mOA")


# ---------------------------------------------------------------- life cycle


def test_reset_gives_the_same_trajectory(twin, winter):
    t = twin().start({"roo.V": 80.0, "mOut_flow": 0.06})
    first, _, _ = t.run(HOURS, winter, OUTPUTS, hold=True)
    t.fmu.reset()
    assert t.get("roo.V", "mOut_flow", "TDryBul").tolist() == [150.0, 0.15, 293.15]
    t.start({"roo.V": 80.0, "mOut_flow": 0.06})
    again, _, _ = t.run(HOURS, winter, OUTPUTS, hold=True)
    assert np.array_equal(first, again)
    t.fmu.terminate()
    t.fmu.reset()
    assert np.array_equal(t.start().dx, twin().start().dx)


def test_thousands_of_instances_leave_no_memory_behind(twin):
    t = twin()
    fmu = t.fmu
    first = fmu.component
    held = t.allocated

    def cycle(n):
        for _ in range(n):
            fmu.instantiate(callbacks=t.callbacks)
            fmu.setupExperiment()
            fmu.enterInitializationMode()
            fmu.exitInitializationMode()
            state = fmu.getFMUstate()
            fmu.serializeFMUstate(state)
            fmu.freeFMUstate(state)
            fmu.fmi2FreeInstance(fmu.component)

    resource = pytest.importorskip("resource")
    cycle(500)
    before = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    cycle(1000)
    fmu.component = first
    assert t.allocated == held
    assert resource.getrusage(resource.RUSAGE_SELF).ru_maxrss - before < 1000  # kB


def test_wrong_guid_and_type_are_refused(twin):
    t = twin()
    name, guid, uri = b"x", t.description.guid.encode(), b"file:///"
    instantiate = t.fmu.fmi2Instantiate
    assert not instantiate(name, 0, b"{0}", uri, ctypes.byref(t.callbacks), 0, 0)
    assert "GUID" in t.messages[-1]
    assert not instantiate(name, 1, guid, uri, ctypes.byref(t.callbacks), 0, 0)
    assert "Model Exchange" in t.messages[-1]


# ---------------------------------------------------------------- values


def test_calculated_and_fixed_variables_cannot_be_set(twin):
    t = twin()
    with pytest.raises(FMICallException, match="error"):
        t.set(TRoo=300.0)
    assert t.messages[-1] == "TRoo is calculated and cannot be set."
    t.start()
    with pytest.raises(FMICallException, match="error"):
        t.set(roo__V=100.0)
    assert t.messages[-1] == "roo.V is fixed once the instance is initialised."
    with pytest.raises(FMICallException, match="error"):
        t.set(replay=True)
    t.set(TDryBul=280.0)  # inputs can


BAD = [
    ({"roo.V": -1.0}, "roo.V"),
    ({"roo.hRoo": math.nan}, "roo.hRoo"),
    ({"mOut_flow": math.inf}, "mOut_flow"),
    ({"glaSys.UFra": 6.0}, "glaSys.UFra"),
    ({"fraWin": 1.0}, "fraWin"),
    ({"people.fraRad": 0.7, "people.fraCon": 0.7}, "people.fraRad"),
    ({"floor.layer[1].R": 0.0, "floor.layer[2].R": 0.0}, "floor.layer"),
    ({"innWal.layer[1].C": 0.0, "innWal.layer[2].R": 0.0}, "innWal.layer"),
    ({"effect.furniture.C": -1e9}, "effect.furniture.C"),
    ({"TDryBul": math.nan}, "TDryBul"),
]


@pytest.mark.parametrize(("values", "name"), BAD)
def test_bad_values_are_refused_by_name(twin, values, name):
    t = twin()
    with pytest.raises(FMICallException, match="fmi2ExitInitializationMode"):
        t.start(values)
    assert len(t.messages) == 1
    assert name in t.messages[0]
    assert t.messages[0].endswith(".")
    t.fmu.reset()
    t.start()  # and the instance can still be used
    assert np.all(np.isfinite(t.dx))


def test_values_that_are_not_finite_are_discarded_and_forgiven(twin):
    bad = math.nan
    t = twin().start()
    good_x, good = t.x, t.dx
    for k in range(t.n):
        x = good_x.copy()
        x[k] = bad
        t.x = x
        with pytest.raises(FMICallException, match="discard"):
            _ = t.dx
        assert t.states[k] in t.messages[-1] or "der(" in t.messages[-1]
    t.x = good_x
    for name in ("TDryBul", "TSky", "winSpe", "HFac", "CO2Out", "nPer", "TSet", "excHea", "excOut"):
        value = t.get(name)[0]
        t.set_all({name: bad})
        with pytest.raises(FMICallException, match="discard"):
            _ = t.dx
        assert name in t.messages[-1]
        t.fmu.enterEventMode()
        with pytest.raises(FMICallException, match="error"):
            t.fmu.newDiscreteStates()
        t.fmu.enterContinuousTimeMode()
        t.set_all({name: value})
    assert np.array_equal(t.dx, good)


# ---------------------------------------------------------------- FMU state


def test_saved_state_continues_identically(twin, winter):
    t = twin().start({"roo.V": 70.0, "mOut_flow": 0.05, "gaiCO2.k": 1.2e-5})
    t.run(HOURS[:13], winter, hold=True)
    state = t.fmu.getFMUstate()
    serialized = t.fmu.serializeFMUstate(state)
    first, _, _ = t.run(HOURS[12:], winter, OUTPUTS, hold=True)
    t.set(TDryBul=300.0)
    t.fmu.setFMUstate(state)
    second, _, _ = t.run(HOURS[12:], winter, OUTPUTS, hold=True)
    t.fmu.freeFMUstate(state)
    other = twin()  # another instance, from bytes, with its parameters and modes
    restored = other.fmu.deSerializeFMUstate(serialized)
    other.fmu.setFMUstate(restored)
    other.fmu.freeFMUstate(restored)
    third, _, _ = other.run(HOURS[12:], winter, OUTPUTS, hold=True)
    assert np.ptp(first[:, 3]) > 0.01
    assert np.array_equal(first, second)
    assert np.array_equal(first, third)
    assert other.get("roo.V")[0] == 70.0
