"""Readers of ``shared``: descriptions, datasets, ceilings."""

import shutil
from pathlib import Path

from shared.ceiling import read_ceilings
from shared.store import DatasetFolder
from shared.system import load_system
from tests.hostile.damage import damage_bytes, damage_json, damage_text
from tests.hostile.trial import Reader
from tests.trainer.conftest import make_dataset

ROOM = Path(__file__).resolve().parents[2] / "fmus" / "MixedAirCO2"


def dataset(folder: Path) -> Path:
    """A small whole dataset."""
    return make_dataset(folder, systems=10) if not folder.exists() else folder


def load(folder: Path) -> None:
    """What training does with a dataset."""
    from trainer.reading.data import load_records

    load_records(DatasetFolder(folder), None)


def readers(folder: Path) -> list[Reader]:
    """All of them, each on files of its own below ``folder``."""
    for name in ("system", "ceiling"):
        (folder / name).mkdir(parents=True)
    shutil.copyfile(ROOM / "system.toml", folder / "system" / "system.toml")
    shutil.copyfile(ROOM / "identifiability.json", folder / "ceiling" / "identifiability.json")
    shard = "shards/000.nc"

    def facts(at: Path) -> None:
        opened = DatasetFolder(at)
        opened.shard_facts(opened.manifest.shards[0])

    return [
        Reader("system description", folder / "system", "system.toml", load_system, damage_text),
        Reader(
            *("dataset manifest", dataset(folder / "ds1"), "manifest.json", load, damage_json),
            # its shards are held against it: then it is their names that are said
            named=False,
        ),
        Reader("shard, training", dataset(folder / "ds2"), shard, load, damage_bytes),
        Reader("shard, datagen verify", dataset(folder / "ds3"), shard, facts, damage_bytes, examples=3),
        Reader(
            *("ceilings", folder / "ceiling", "identifiability.json"),
            *(lambda at: read_ceilings(at / "identifiability.json"), damage_json),
        ),
    ]
