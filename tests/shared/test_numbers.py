"""Numbers and counts as people read them."""

import pytest

from shared.numbers import counted, number


@pytest.mark.parametrize(
    ("value", "digits", "signed", "text"),
    [
        (-282.049, 2, False, "-280"),
        (1234.5, 3, False, "1230"),
        (3.7e-6, 2, False, "3.7e-06"),
        (2.5e7, 2, False, "2.5e+07"),
        (-0.0, 4, False, "0"),
        (None, 4, False, "–"),
        (1050.0, 3, True, "+1050"),
        (-1050.0, 3, True, "-1050"),
        (0.0, 3, True, "0"),
    ],
)
def test_numbers_are_written_without_powers_of_ten_and_zero_without_a_sign(value, digits, signed, text):
    assert number(value, digits, signed=signed) == text


def test_one_has_no_plural():
    assert [counted(n, "system") for n in (0, 1, 2)] == ["0 systems", "1 system", "2 systems"]
    assert [counted(n, "entry", "entries") for n in (1, 2)] == ["1 entry", "2 entries"]
