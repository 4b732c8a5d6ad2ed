"""The oldest versions that the project says it runs with have what its code calls."""

import re
import tomllib
from pathlib import Path

import pytest

from shared import __file__ as home

PROJECT = Path(home).parents[1] / "pyproject.toml"


@pytest.mark.skipif(not PROJECT.exists(), reason="installed without its sources")
@pytest.mark.parametrize(
    ("extra", "package", "least"),
    [
        ("trainer", "torch", (2, 9)),  # torch.optim.Muon
        ("datagen", "distributed", (2025, 4)),  # Client.scheduler_info(n_workers=-1)
        ("datagen", "dask", (2025, 4)),  # a release of distributed wants the one of dask
    ],
)
def test_a_lower_bound_is_not_below_what_is_called(extra, package, least):
    wanted = tomllib.loads(PROJECT.read_text())["project"]["optional-dependencies"][extra]
    bounds = [re.fullmatch(rf"{package}>=([\d.]+)", one) for one in wanted]
    (found,) = [tuple(int(part) for part in one[1].split(".")) for one in bounds if one]
    assert found >= least
