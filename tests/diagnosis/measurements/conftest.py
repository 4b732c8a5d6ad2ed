"""What the tests of the import share."""

import pytest

from diagnosis.measurements.importer import import_recording
from tests.diagnosis.measurements.house_cases import HOUSE, MAPPING


@pytest.fixture(autouse=True)
def undrawn(request, monkeypatch):
    """Drawing takes most of an import's time: only tests of the picture draw it."""
    if "picture" not in request.node.name:
        monkeypatch.setattr("diagnosis.measurements.importer.draw_recording", lambda *_: b"no picture")


@pytest.fixture
def house(tmp_path):
    """Write mapping, system and data; import them; return the report."""

    def run(frame, mapping=MAPPING, out="out/house.nc", **more):
        (tmp_path / "house.toml").write_text(HOUSE)
        (tmp_path / "mapping.toml").write_text(mapping)
        frame.to_csv(tmp_path / "data.csv", index=False)
        return import_recording(tmp_path / "mapping.toml", tmp_path / "data.csv", out=tmp_path / out, **more)

    return run
