"""The command ``datagen simulate``."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

from cyclopts import Parameter
from rich.table import Table

from shared.assignments import assignments
from shared.console import OK, NotNegative, Place, new_console
from shared.watchdog import PATIENT, Patience

console = new_console()


def simulate(
    system: Path,
    *,
    out: Place,
    set_: Annotated[list[str] | None, Parameter(name="--set", consume_multiple=True, negative=())] = None,
    hours: float | None = None,
    step: float | None = None,
    seed: NotNegative = 0,
    index: NotNegative = 0,
    excitation: bool = True,
    uncertain: Annotated[bool, Parameter(negative=())] = False,
    patience: Patience = PATIENT,
) -> int:
    """Simulate one system into a NetCDF file, in the form of a recording.

    Parameters
    ----------
    system
        System description (TOML), its folder, or the name of one that comes with the package.
    out
        The NetCDF file to write.
    set_
        Parameter values as NAME=VALUE; the others are drawn as the farm would for this seed and index.
    hours
        Length of the record [h]; by default the description's.
    step
        Output step [s]; by default the description's.
    seed
        Root seed of what is drawn: parameters that are not set, occupancy, weather file.
    index
        System index of what is drawn.
    excitation
        Add the description's small sinusoids to the control actions.
    uncertain
        Draw the description's [[uncertain]] constants, too, except those that are set.
    """
    from datagen import simulate as simulate_

    record = simulate_(
        system,
        parameters=assignments(set_ or []),
        out=out,
        hours=hours,
        step=step,
        seed=seed,
        index=index,
        excitation=excitation,
        uncertain=uncertain,
    )
    table = Table("variable", "unit", "minimum", "mean", "maximum", box=None)
    for name, values in record.data_vars.items():
        if values.attrs.get("role") in ("parameter", "constant"):
            table.add_row(str(name), values.attrs["units"], "", f"{float(values):.5g}", "")
        elif values.attrs.get("role") == "output":
            low, mean, high = (f"{float(f()):.5g}" for f in (values.min, values.mean, values.max))
            table.add_row(str(name), values.attrs["units"], low, mean, high)
    console.print(table)
    console.print(f"written to {out}", markup=False)
    return OK
