"""Text in pictures is that of whoever named things."""

import numpy as np
import pytest

from diagnosis.pictures import as_png, embedded, figure, readable


def test_dollars_in_any_text_of_a_picture_are_no_formula():
    odd = "a$20b_$c"
    made, (panel, other) = figure(2, sharex=False)
    panel.barh([odd, "b"], [1.0, 2.0], label=odd)
    panel.set_title(odd)
    panel.set_xlabel(odd)
    panel.text(0.5, 0.5, odd)
    panel.legend()
    other.plot([1, 2], [1, 2])
    other.set_xticks([1, 2], [odd, odd])
    made.suptitle(odd)
    assert embedded(made).startswith("data:image/png;base64,")
    assert panel.get_yticklabels()[0].get_text() == odd


def test_powers_of_ten_on_a_logarithmic_axis_are_still_drawn_as_such():
    made, (panel,) = figure()
    panel.plot([1, 1000], [1, 2])
    panel.set_xscale("log")
    panel.set_title("cost in $")
    assert as_png(made)[:4] == b"\x89PNG"
    labels = panel.get_xticklabels()
    assert any("mathdefault" in one.get_text() for one in labels)
    assert all(one.get_parse_math() for one in labels)


def test_differences_of_temperature_stay_in_kelvin():
    swing = np.array([-0.5, 0.0, np.nan, 0.5])
    assert readable(swing, "K")[1] == "K"
    np.testing.assert_array_equal(readable(swing, "K")[0], swing)
    warm, unit = readable(np.array([293.15, np.nan]), "K")
    assert unit == "°C" and warm[0] == pytest.approx(20.0)
