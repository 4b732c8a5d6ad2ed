"""A benchmark that takes seconds."""

import shutil

import pytest

import trainer

from ..conftest import PICTURES, TANK, draw_nothing, make_dataset

QUICK = {"parts": ["channels"], "ours": ["lstm", "mean"], "steps": 2, "seeds": 2, "windows": 60}


@pytest.fixture(scope="session")
def short(tmp_path_factory):
    """A dataset of 100 tanks over two days."""
    return make_dataset(tmp_path_factory.mktemp("short") / "ds", text=TANK.replace("hours = 240.0", "hours = 48.0"))


@pytest.fixture(scope="session")
def results(short, tmp_path_factory):
    """A finished benchmark of six lines, two seeds each."""
    out = tmp_path_factory.mktemp("results")
    with pytest.MonkeyPatch.context() as patch:
        for one in PICTURES:
            patch.setattr(one, draw_nothing)
        trainer.benchmark(short, out, command="trainer benchmark tanks", **QUICK)
    return out


@pytest.fixture
def finished(results, tmp_path):
    """A copy of the finished benchmark, to do it again."""
    return shutil.copytree(results, tmp_path / "finished")
