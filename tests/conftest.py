"""What all tests share."""

import os
import subprocess
import sys
from pathlib import Path

import pytest
from hypothesis import settings

from shared.system import load_system
from tests.forked import Forked

# new examples are for people who can look at what they find; CI repeats the ones it knows
# how long an example takes says how busy a machine is
settings.register_profile("ci", derandomize=True, deadline=None, max_examples=30)
settings.register_profile("here", deadline=None, max_examples=30)
settings.load_profile("ci" if os.environ.get("CI") else "here")

ROOT = Path(__file__).resolve().parents[1]
LONGEST = (
    "datagen/farming/test_faults.py",
    "diagnosis/app/test_page.py",
    "docs/test_notebooks.py",
    "packaging/test_wheel.py",
    "docs/test_gallery.py",
    "docs/test_pages.py",
    "docker/test_images.py",
    "diagnosis/gap/test_shrinkage.py",
    "diagnosis/gap/test_gap.py",
    "diagnosis/gap/test_page.py",
    "diagnosis/blind/test_running.py",
    "docker/test_farm.py",
    "trainer/benchmarking/test_running.py",
    "diagnosis/fitting/test_fit.py",
    "diagnosis/gap/test_limits.py",
    "diagnosis/app/test_project.py",
    "diagnosis/farming/test_farm.py",
)
"""Files that take longest, in that order. They come first: where files are dealt out to processes, one that begins late
keeps a process busy when the others have nothing left to do."""


TOGETHER = {
    "drifted": ("gap/test_gap.py", "gap/test_page.py", "gap/test_shrinkage.py"),
    "results": ("benchmarking/test_running.py", "benchmarking/test_results.py"),
    "calibrated": ("calibrating/test_report.py", "calibrating/test_calibration.py"),
}
"""Fixtures of a session that take long to make: files that use one of them go to the same process."""


def pytest_collection_modifyitems(items):
    """Sort by file alone: within a file, and among all other files, the order stays."""
    place = {ROOT / "tests" / name: k for k, name in enumerate(LONGEST)}
    items.sort(key=lambda item: place.get(item.path, len(place)))


@pytest.hookimpl(optionalhook=True)
def pytest_xdist_make_scheduler(config, log):
    """A file is dealt out as a whole, with those that share a fixture: what tests share is made once.

    The marks of ``--dist loadgroup`` do not reach xdist 3.8 from pytest 9.2.
    """
    from xdist.scheduler import LoadFileScheduling

    class ByFixture(LoadFileScheduling):
        def _split_scope(self, nodeid):
            file = super()._split_scope(nodeid)
            return next((name for name, files in TOGETHER.items() if file.endswith(files)), file)

    return ByFixture(config, log)


@pytest.fixture(scope="session", autouse=True)
def forked_readers():
    """Children that read NetCDF files are forked, where that can be done safely: to start each takes far longer."""
    if sys.platform != "linux":
        yield
        return
    forked = Forked()
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr("shared.netcdf.subprocess", forked)
        yield
    forked.close()


@pytest.fixture
def started_readers(monkeypatch):
    """Children that read NetCDF files are started, as users have them."""
    monkeypatch.setattr("shared.netcdf.subprocess", subprocess)


@pytest.fixture(scope="session")
def default_system():
    """The default system, as users get it."""
    return load_system(ROOT / "fmus" / "MixedAirCO2")
