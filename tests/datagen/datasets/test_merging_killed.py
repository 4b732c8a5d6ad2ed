"""A merge into a folder that was there, stopped while what it had made got to its place."""

from pathlib import Path

import pytest

from datagen import info, merge
from shared.errors import DatasetError
from tests.trainer.conftest import make_dataset

PARTS = ["shards", "README.md", "failures.jsonl"]


@pytest.fixture
def two(tmp_path):
    return [make_dataset(tmp_path / f"{k}", systems=4, root_seed=k, settings={"excitation": True}) for k in (1, 2)]


def content(folder):
    return {str(one.relative_to(folder)): one.read_bytes() for one in sorted(folder.rglob("*")) if one.is_file()}


@pytest.mark.parametrize("moved", [0, 3])
def test_what_it_had_moved_bars_no_second_one(two, tmp_path, moved):
    merge(two, tmp_path / "whole")
    out = tmp_path / "out"
    out.mkdir()
    merge(two, out)
    assert {one.name for one in out.iterdir()} == {*PARTS, "manifest.json"}
    draft = out / ".merging"
    draft.mkdir()
    for name in [*PARTS, "manifest.json"][moved:]:
        (out / name).rename(draft / name)
    merge(two, out)
    assert content(out) == content(tmp_path / "whole")
    assert not draft.exists()
    assert info(out).complete


@pytest.mark.parametrize("error", [KeyboardInterrupt(), OSError(28, "No space left on device")])
def test_stopped_in_between_it_leaves_the_folder_empty(two, tmp_path, monkeypatch, error):
    out, real = tmp_path / "out", Path.rename
    out.mkdir()

    def rename(path, target):
        if path.name == "manifest.json":
            raise error
        return real(path, target)

    with monkeypatch.context() as patch, pytest.raises((KeyboardInterrupt, DatasetError)):
        patch.setattr(Path, "rename", rename)
        merge(two, out)
    assert list(out.iterdir()) == []
