"""Weather that comes with pvlib, and the sun over its places."""

import pytest

from datagen.driving import weather_record

GREENSBORO = "pvlib:723170TYA.CSV"
"""A weather file by the name that a description gives it."""


@pytest.fixture(scope="module", autouse=True)
def sun_worked_out_once():
    """Where the sun stands over a place by one clock is the same for all tests of a file, and takes long."""
    real, known = weather_record.sun_at, {}

    def sun_at(times, **place):
        key = (times.asi8.tobytes(), *place.values())
        if key not in known:
            known[key] = real(times, **place)
        return known[key]

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(weather_record, "sun_at", sun_at)
        yield
