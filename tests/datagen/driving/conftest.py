"""What tests of inputs share."""

import pytest

from datagen.driving import weather_record


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
