"""What an import understood, and what it could not use."""

from __future__ import annotations

from collections.abc import Sequence

from pydantic import BaseModel, ConfigDict
from rich.console import Console
from rich.table import Table as Grid

from shared.system import System
from shared.units import ABSOLUTE
from shared.variables import ZERO_CELSIUS, OccupancyInput


class _Table(BaseModel):
    model_config = ConfigDict(extra="forbid")


class VariableReport(_Table):
    """One variable of the recording.

    ``origin`` is where it comes from in a few words. ``minimum``, ``mean`` and ``maximum`` are of the recording [unit].
    ``impossible`` and ``stuck`` count readings left out; ``missing``, ``partly``, ``interpolated`` and ``assumed``
    count steps of the recording.
    """

    name: str
    role: str
    unit: str
    method: str
    origin: str
    readings: int
    minimum: float | None
    mean: float | None
    maximum: float | None
    impossible: int
    stuck: int
    missing: int
    partly: int
    interpolated: int
    assumed: int
    computed: bool


class Comparison(_Table):
    """Two meters of one quantity, on the steps where both have a value; differences are used minus second meter.

    There is no ``correlation`` where one of them, or a constant in the first one's place, never changes.
    """

    name: str
    second: str
    unit: str
    steps: int
    mean_difference: float
    sd_difference: float
    largest_difference: float
    correlation: float | None


class ImportReport(_Table):
    """What :func:`diagnosis.importing.import_recording` returns and ``diagnosis import --json`` prints.

    ``not_recorded`` are the variables that the recording lacks, ``lacking`` what that means for each kind of them.
    ``begin`` and ``end`` are local standard time, ``utc_offset`` hours east of Greenwich, ``time_zero`` the Monday from
    which the recording's seconds count.
    """

    schema_version: int = 2
    recording: str
    picture: str
    data: str
    system: str
    rows: int
    interval: float
    zone: str
    utc_offset: float
    time_zero: str
    begin: str
    end: str
    step: float
    steps: int
    variables: list[VariableReport]
    comparisons: list[Comparison]
    not_recorded: list[str]
    lacking: list[str]
    unused_columns: list[str]
    notes: list[str]


def sentences_of(missing: Sequence[str], system: System) -> list[str]:
    """What it means that variables of a system are not in a recording: outputs, persons, and other inputs."""
    crowd = {one.name for one in system.inputs if isinstance(one, OccupancyInput)}
    outputs = [name for name in missing if name in system.output_names]
    persons = [name for name in missing if name in crowd]
    inputs = [name for name in missing if name not in {*outputs, *persons}]
    said = []
    if outputs:
        said.append(f"not measured: {', '.join(outputs)}: fits know nothing of it, and an estimator may need it")
    if persons:
        said.append(f"nobody counted persons ({', '.join(persons)}): fits take them for unknown")
    if inputs:
        said.append(f"not recorded: {', '.join(inputs)}: needed by a simulation of this recording")
    return said


def _number(value: float | None, unit: str) -> str:
    if value is None:
        return "-"
    return f"{value - ZERO_CELSIUS:.1f} °C" if unit == "K" and value > ABSOLUTE else f"{value:.4g}"


def print_report(report: ImportReport, console: Console) -> None:
    """Print a report for people."""
    hours = report.steps * report.step / 3600.0
    console.print(
        f"{report.data}: {report.rows} rows, usually {report.interval:g} s apart; clock of {report.zone}, "
        f"kept in local standard time (UTC{report.utc_offset:+g} h)",
        markup=False,
        soft_wrap=True,
    )
    console.print(
        f"{report.recording}: {report.begin} to {report.end}, {report.steps} steps of {report.step:g} s "
        f"({hours / 24:.1f} days)",
        markup=False,
        soft_wrap=True,
    )
    table = Grid("variable", "unit", "from", "min", "mean", "max", "missing", "left out", "filled", box=None)
    for one in report.variables:
        left = [f"{n} {what}" for n, what in ((one.impossible, "impossible"), (one.stuck, "stuck")) if n]
        filled = [f"{one.interpolated} interpolated"] if one.interpolated else []
        if 0 < one.assumed < report.steps:
            filled.append(f"{one.assumed} assumed")
        if one.partly:
            filled.append(f"{one.partly} partly")
        table.add_row(
            one.name,
            one.unit,
            one.origin,
            *(_number(value, one.unit) for value in (one.minimum, one.mean, one.maximum)),
            f"{one.missing / report.steps:.1%}" if one.missing else "-",
            ", ".join(left) or "-",
            ", ".join(filled) or "-",
        )
    console.print(table, markup=False)
    for pair in report.comparisons:
        together = f"correlation {pair.correlation:.2f} " if pair.correlation is not None else ""
        console.print(
            f"{pair.name}: used minus second meter ({pair.second}): {pair.mean_difference:+.3g} {pair.unit} on average,"
            f" standard deviation {pair.sd_difference:.3g}, at most {pair.largest_difference:.3g}, "
            f"{together}over {pair.steps} steps",
            markup=False,
            soft_wrap=True,
        )
    for note in report.notes:
        console.print(f"- {note}", markup=False, soft_wrap=True)
    for sentence in report.lacking:
        console.print(sentence, style="yellow", markup=False, soft_wrap=True)
    if report.unused_columns:
        console.print(f"columns not used: {', '.join(report.unused_columns)}", markup=False, soft_wrap=True)
    console.print(f"picture: {report.picture}", markup=False, soft_wrap=True)
