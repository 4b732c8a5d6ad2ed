import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from shared.codes import CODES, coded


@pytest.mark.parametrize("code", [-9999.0, -999.9, -99.0, 9999.0, 99999.0])
def test_a_code_among_powers_is_one(code):
    readings = np.array([0.0, 120.0, 340.0, 410.0, 90.0, code, 15.0, code])
    np.testing.assert_array_equal(coded(readings), readings == code)
    np.testing.assert_array_equal(coded(readings.astype(np.float32).astype(float)), coded(readings))


def test_readings_that_happen_to_be_nines_are_none():
    assert not coded(np.array([430.0, 512.0, 640.0, 800.0, 930.0, 999.0, 610.0])).any()  # CO2 [ppm]
    assert not coded(np.array([0.0, 12.0, 30.0, 41.0, 45.0, 99.0])).any()  # irradiance in winter [W/m2]
    assert not coded(np.array([0.0, 0.0, 99.0, 99.0, 0.0, 99.0])).any()  # a valve that is open or shut [%]


@pytest.mark.parametrize(("others", "code"), [((0.0, 1500.0), -9999.0), ((0.0, 1.0, 2.0), 65535.0)])
def test_a_code_among_few_readings_is_one_where_it_is_many_times_as_large(others, code):
    """A heater that is on or off, a counter in a small room."""
    readings = np.array([*others, code, *others])
    np.testing.assert_array_equal(coded(readings), readings == code)
    assert not coded(np.array([0.0, 500.0, 999.0, 0.0])).any()


@given(st.lists(st.floats(-500, 500).filter(lambda one: one not in CODES), min_size=2, max_size=40))
def test_what_is_no_nines_never_is(readings):
    assert not coded(np.array(readings)).any()
