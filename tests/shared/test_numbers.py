"""Numbers and counts as people read them."""

import pytest

from shared.numbers import counted, number


@pytest.mark.parametrize(
    ("value", "digits", "text"),
    [
        (-282.049, 2, "-280"),
        (1234.5, 3, "1230"),
        (3.7e-6, 2, "3.7e-06"),
        (2.5e7, 2, "2.5e+07"),
        (-0.0, 4, "0"),
        (None, 4, "–"),
    ],
)
def test_numbers_are_written_without_powers_of_ten_and_zero_without_a_sign(value, digits, text):
    assert number(value, digits) == text


@pytest.mark.parametrize(
    ("value", "text"), [(118.0, "+118"), (1050.0, "+1050"), (-1050.0, "-1050"), (0.0, "0"), (1.5e-3, "+0.0015")]
)
def test_a_signed_number_has_its_plus(value, text):
    assert number(value, 3, signed=True) == text


def test_one_has_no_plural():
    assert [counted(n, "system") for n in (0, 1, 2)] == ["0 systems", "1 system", "2 systems"]
    assert [counted(n, "entry", "entries") for n in (1, 2)] == ["1 entry", "2 entries"]
