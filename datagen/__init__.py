"""The simulation farm: samples systems, simulates FMUs, writes datasets.

The functions behind the commands of the same names: :func:`describe`, :func:`run`, :func:`simulate`, :func:`info`,
:func:`verify`, :func:`repair`, :func:`merge`, :func:`compare`, :func:`identifiability`. :func:`open` gives a dataset to
xarray.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

from shared.lazy import lazily

if TYPE_CHECKING:
    from datagen.comparing.comparison import compare as compare
    from datagen.datasets.inspection import info as info
    from datagen.datasets.inspection import verify as verify
    from datagen.datasets.mending import repair as repair
    from datagen.datasets.merging import merge as merge
    from datagen.datasets.opening import open as open
    from datagen.farming.farm import run as run
    from datagen.fmi.describe import describe as describe
    from datagen.limits.ceilings import identifiability as identifiability
    from datagen.simulating.recording import simulate as simulate

__all__ = ["compare", "describe", "identifiability", "info", "merge", "open", "repair", "run", "simulate", "verify"]

_HOMES = {
    "compare": "datagen.comparing.comparison",
    "describe": "datagen.fmi.describe",
    "identifiability": "datagen.limits.ceilings",
    "info": "datagen.datasets.inspection",
    "merge": "datagen.datasets.merging",
    "open": "datagen.datasets.opening",
    "repair": "datagen.datasets.mending",
    "run": "datagen.farming.farm",
    "simulate": "datagen.simulating.recording",
    "verify": "datagen.datasets.inspection",
}

__getattr__ = lazily(__name__, _HOMES)


def __dir__() -> list[str]:
    """What tab completion offers."""
    return __all__
