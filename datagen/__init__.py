"""The simulation farm: samples systems, simulates FMUs, writes datasets.

The functions behind the commands of the same names: :func:`describe`, :func:`run`, :func:`simulate`, :func:`info`,
:func:`verify`, :func:`repair`, :func:`merge`, :func:`copy`, :func:`compare`, :func:`identifiability`. :func:`open`
gives a dataset to xarray; :func:`load_system`, :class:`Simulator` and :func:`ceilings_of` are for studies of one's own.
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
    from datagen.limits.ceilings import ceilings_of as ceilings_of
    from datagen.limits.ceilings import identifiability as identifiability
    from datagen.simulating.recording import simulate as simulate
    from datagen.simulating.simulator import Simulator as Simulator
    from shared.remote import copy as copy
    from shared.system import load_system as load_system

_HOMES = {
    "Simulator": "datagen.simulating.simulator",
    "ceilings_of": "datagen.limits.ceilings",
    "compare": "datagen.comparing.comparison",
    "copy": "shared.remote",
    "describe": "datagen.fmi.describe",
    "identifiability": "datagen.limits.ceilings",
    "info": "datagen.datasets.inspection",
    "load_system": "shared.system",
    "merge": "datagen.datasets.merging",
    "open": "datagen.datasets.opening",
    "repair": "datagen.datasets.mending",
    "run": "datagen.farming.farm",
    "simulate": "datagen.simulating.recording",
    "verify": "datagen.datasets.inspection",
}

__all__ = list(_HOMES)
__getattr__ = lazily(__name__, _HOMES)


def __dir__() -> list[str]:
    """What tab completion offers."""
    return __all__
