"""Options that every command has which fits a recording by simulation."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Any, Literal

from cyclopts import Parameter


@Parameter(name="*")
@dataclass(frozen=True)
class Fitting:
    """How a recording is taken, where a fit begins, and where its simulations run."""

    run: Annotated[
        Path | None,
        Parameter(
            help="Estimator to start from: its folder, or the name of a system that comes with one. Without, a fit"
            " starts from the middle of the prior, and `diagnosis run` from the estimator beside the description."
        ),
    ] = None
    replay: Annotated[
        bool, Parameter(help="Drive the model with the recorded actuators in place of its control loops.")
    ] = False
    occupancy: Annotated[
        Literal["measured", "unknown"] | None,
        Parameter(help="Whether occupants were counted. Default: measured if the recording has them."),
    ] = None
    noise: Annotated[str | None, Parameter(help="Noise preset of the description. Default: `sensor`.")] = None
    workers: Annotated[
        int | None, Parameter(help="Processes on this machine that simulate in parallel. Default: one.")
    ] = None
    scheduler: Annotated[
        str | None, Parameter(help="Address of a Dask scheduler, to simulate on its workers instead.")
    ] = None

    minutes: Annotated[
        float | None,
        Parameter(
            help="Stop after about so many minutes, with an answer that says what it lacks. The same command with more"
            " minutes continues."
        ),
    ] = None

    @property
    def given(self) -> dict[str, Any]:
        """As keyword arguments, without those that were not given."""
        return {name: one for name, one in vars(self).items() if one is not None}


PLAIN = Fitting()
"""In this process, with whatever the recording has."""
