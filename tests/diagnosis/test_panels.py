"""Pictures that zoom: what the browser gets."""

import numpy as np
import pytest

from diagnosis.panels import Curve, Panel, Strips, embedded, library, picture

TIME = np.datetime64("2024-02-28T01:00") + np.arange(48) * np.timedelta64(1, "h")


@pytest.fixture
def panels():
    noise, read = Curve("noise", "#888888", np.array([[-0.2], [0.2]])), np.where(np.arange(48) < 9, np.nan, 1.5)
    night = Strips("night", "#eeeeee", TIME[:1], TIME[6:7])
    return [Panel(f"{name} $$x$$", unit, TIME, [noise, Curve("model", "#d9730d", read)], [night]) for name, unit in
            (("air", "K"), ("heater", "W"))]  # fmt: skip


def test_panels_zoom_together_and_the_key_hides_a_curve_in_all_of_them(panels):
    first, second = (one for one, _, _ in picture(panels).children)
    assert first.x_range is second.x_range
    assert [np.datetime64(one) for one in (first.x_range.start, first.x_range.end)] == [TIME[0], TIME[-1]]
    assert [[item.label.value for item in one.items] for one in first.legend] == [["noise", "model", "night"]]
    assert not second.legend and first.legend[0].click_policy == "hide"
    for item in first.legend[0].items:
        ((hook,),) = (one.js_property_callbacks["change:visible"] for one in item.renderers)
        assert hook.args["other"] in second.renderers


def test_the_pointer_reads_time_and_value_with_their_unit(panels):
    for unit, (drawn, _, _) in zip("KW", picture(panels).children, strict=True):
        (hover,) = (one for one in drawn.tools if type(one).__name__ == "HoverTool")
        assert "@time{%a %d %b %H:%M}" in hover.tooltips and f"@{{model}}{{%.4g}} {unit}</div>" in hover.tooltips
        assert drawn.title.text.text.endswith(f"[{unit}]")
        assert "noise" not in hover.tooltips  # it is the same at all times


def test_a_picture_is_part_of_one_file(panels):
    """A formula between dollars would be drawn by what lies elsewhere."""
    html = embedded(panels)
    assert "src=" not in html and "http" not in html and '"name":"PlainText"' in html
    assert "<noscript>" in html and " src=" not in library()[:200] and len(library()) < 1_500_000
    assert embedded([]) == ""
