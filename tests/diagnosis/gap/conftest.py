"""A diagnosis that several tests look at."""

from types import SimpleNamespace

import pytest

from diagnosis.gap.diagnosed import diagnose
from tests.diagnosis.conftest import WARM_UP
from tests.diagnosis.gap.gap_cases import candidates, drifting


@pytest.fixture(autouse=True)
def undrawn(monkeypatch):
    """Pictures take most of a page's time: only that of the diagnosis below has them."""
    monkeypatch.setattr("diagnosis.gap.page.embedded", lambda _: "no picture")


@pytest.fixture(scope="session")
def drifted(house, house_recorded, tmp_path_factory):
    """A room sensor that drifts: recording, diagnosis, and folder of the report; made once, so leave it as it is."""
    system, folder = house("me"), tmp_path_factory.mktemp("drifted")
    path = drifting(house_recorded(folder, hours=336, seed=3))
    out = folder / "out"
    done = diagnose(system, path, effects=candidates(system), warm_up=WARM_UP, out=out)
    return SimpleNamespace(path=path, out=out, done=done)
