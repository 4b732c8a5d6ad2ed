"""What the card of a dataset says of how much is in it."""

import pytest

from datagen.farming.card import write_card
from shared.manifest import Manifest, ShardEntry
from shared.system import load_system


@pytest.mark.parametrize(
    ("asked", "shards", "said"),
    [
        (1, [[0]], ("1 simulated system", "1 of 1 system", "in 1 shard")),
        (1, [], ("0 simulated systems", "0 of 1 system", "in 0 shards")),
        (4, [[0, 1], [2]], ("3 simulated systems", "3 of 4 systems", "in 2 shards")),
    ],
)
def test_one_is_not_told_as_several(tmp_path, asked, shards, said):
    system = load_system("MixedAirCO2")
    manifest = Manifest(
        system_name=system.name,
        system_hash="0" * 64,
        system="{}",
        fmu_sha256="0" * 64,
        root_seed=0,
        systems=asked,
        shard_size=2,
        settings={"excitation": True},
        shards=[
            ShardEntry(file=f"shards/{k}.nc", systems=one, sha256="0" * 64, content_hash="0" * 64)
            for k, one in enumerate(shards)
        ],
    )
    write_card(tmp_path, manifest, system)
    title, *_, how_many, where = (tmp_path / "README.md").read_text().splitlines()[:6]
    assert title.endswith(f": {said[0]}")
    assert how_many.startswith(f"{said[1]}, ") and f"{said[2]}. " in where
