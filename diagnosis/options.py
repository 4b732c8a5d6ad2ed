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
            help="Folder of an estimator, or the name of a system that comes with one: its estimate is the first start."
            " Without, the middle of the prior (for `diagnosis run` the estimator beside the system description, if"
            " there is one)."
        ),
    ] = None
    replay: Annotated[bool, Parameter(help="The recorded actuators replace the model's control loops.")] = False
    occupancy: Annotated[
        Literal["measured", "unknown"] | None,
        Parameter(help="Whether persons were counted; without this, they were if the recording has them."),
    ] = None
    noise: Annotated[str | None, Parameter(help="Noise preset of the description; `sensor`, if not given.")] = None
    workers: Annotated[
        int | None, Parameter(help="Processes on this machine that simulate side by side; one, if not given.")
    ] = None
    scheduler: Annotated[
        str | None, Parameter(help="Address of a Dask scheduler, to simulate on its workers in place of those.")
    ] = None

    minutes: Annotated[
        float | None,
        Parameter(
            help="Time that there is. When it is up, the answer is what is known then, and says what it lacks; given"
            " again, the command goes on from there."
        ),
    ] = None

    @property
    def given(self) -> dict[str, Any]:
        """As keyword arguments, without those that were not given."""
        return {name: one for name, one in vars(self).items() if one is not None}


PLAIN = Fitting()
"""In this process, with whatever the recording has."""
