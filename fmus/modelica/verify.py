"""Check an exported FMU: it loads, its parameters are reachable and act, and it simulates what the tool simulates.

    python fmus/modelica/verify.py build/TunableRoom.fmu --tool build/Verification_res.csv --write build/system.toml

Needs the extra `datagen`. The last step holds the FMU against the tool's own simulation of the model `Verification`,
whose inputs are repeated here. Any failure is one sentence, and exit code 1.
"""

from __future__ import annotations

import argparse
import re
import sys
from collections.abc import Iterator
from os.path import relpath
from pathlib import Path

import fmpy
import numpy as np
import pandas as pd

from datagen.driving.tables import InputTable, Piecewise, merge
from datagen.simulating.liveness import check_live
from datagen.simulating.simulator import Simulator
from shared.errors import FmuError, SystemDescriptionError, ZeroshotError
from shared.system import System, load_system, parse_system

DEFAULT_SYSTEM = Path(__file__).resolve().parent.parent / "MixedAirCO2" / "system.toml"
STEP = 3600.0
KNOTS = 120.0
"""Between the knots of the inputs [s]: straight lines for sinusoids of some hours."""
ALLOWED = 3.0
"""Root mean square by which FMU and tool may differ, in units of an output's accuracy."""


def at_fmu(system: Path, fmu: Path, where: Path) -> System:
    """The description ``system`` around another FMU, as if it lay at ``where``.

    Raises
    ------
    SystemDescriptionError
        If the description cannot be read, or has no line that names its FMU.
    """
    load_system(system)
    return parse_system(_with_fmu(system, fmu, where), where)


def _with_fmu(system: Path, fmu: Path, where: Path) -> str:
    line = f'fmu = "{Path(relpath(fmu.resolve(), where.resolve().parent)).as_posix()}"'
    text, count = re.subn(r"(?m)^fmu\s*=.*$", lambda _: line, system.read_text(encoding="utf-8"), count=1)
    if count != 1:
        raise SystemDescriptionError(f"{system}: no line `fmu = ...` to put another FMU into; expected one")
    return text


def verification_inputs(system: System, stop: float) -> InputTable:
    """The inputs of ``ZeroshotRoom.Verification`` from 0 to ``stop`` [s]; others are zero.

    These are the names of the room's interface, which the Modelica model fixes too.
    """
    time = np.arange(0.0, stop + KNOTS, KNOTS)
    day = 2 * np.pi * time / 86400.0
    known = {
        "TDryBul": 275.15 - 5 * np.cos(day),
        "TSky": 262.15 - 5 * np.cos(day),
        "winSpe": 3 + 2 * np.sin(day / 3),
        "HFac": 200 * (1 - np.cos(day)),
        "CO2Out": np.full_like(day, 420.0),
        "nPer": 14 * (1 - np.cos(day)),
        "TSet": 293.15 - 2 * np.cos(day),
        "excHea": 300 * np.sin(7 * day),
        "excOut": 0.005 * np.sin(5 * day),
    }
    missing = [name for name in known if name not in system.input_names]
    if missing:
        raise SystemDescriptionError(
            f"{system.path}: has no input {missing[0]!r}; the comparison with the tool is for the room's interface"
        )
    signals = {n: Piecewise(time, known[n]) if n in known else Piecewise.constant(0.0) for n in system.input_names}
    return merge(signals, 0.0, stop)


def simulated(system: System, stop: float) -> np.ndarray:
    """Outputs of the FMU with its own parameters under :func:`verification_inputs`, hourly, (outputs, steps)."""
    instants = [one.model_copy(update={"method": "point"}) for one in system.outputs]
    simulator = Simulator(system.model_copy(update={"outputs": instants}))
    return simulator.run({}, verification_inputs(system, stop), start=0.0, stop=stop, step=STEP).outputs


def differences(system: System, tool: Path) -> dict[str, float]:
    """Root mean square of FMU minus tool for each output [unit of each].

    Raises
    ------
    FmuError
        If the tool's file lacks a column, is not hourly, or differs by more than :data:`ALLOWED`.
    """
    try:
        table = pd.read_csv(tool)
    except (OSError, ValueError) as error:
        raise FmuError(f"{tool}: not a readable CSV file: {str(error).splitlines()[0]}") from None
    table.columns = [name.strip().strip('"') for name in table.columns]
    table = table.rename(columns={"Time": "time"})
    for name in ("time", *system.output_names):
        if name not in table:
            raise FmuError(f"{tool}: no column {name!r}; found {', '.join(map(str, table.columns[:20]))}")
    table = table.drop_duplicates("time", keep="first").set_index("time")
    stop = STEP * np.floor(float(table.index[-1]) / STEP + 1e-9)
    hours = STEP * np.arange(1, round(stop / STEP) + 1)
    if len(hours) < 24 or not np.isin(np.round(hours), np.round(table.index)).all():
        raise FmuError(
            f"{tool}: rows are not hourly over at least a day; found {len(table)} up to {table.index[-1]:g} s"
        )
    table.index = np.round(table.index)
    table = table[~table.index.duplicated()].reindex(hours)
    ours = simulated(system, stop)
    found = {}
    for output, values in zip(system.outputs, ours, strict=True):
        found[output.name] = rms = float(np.sqrt(np.mean((values - table[output.name].to_numpy(float)) ** 2)))
        if not rms <= ALLOWED * output.accuracy:
            raise FmuError(
                f"{system.fmu_path}: {output.name} differs from the tool's own simulation by {rms:.3g} {output.unit} "
                f"(root mean square); expected at most {ALLOWED * output.accuracy:g}"
            )
    return found


def verify(system: System, tool: Path | None = None) -> Iterator[str]:
    """The steps one after another; yields a sentence for each that passes, raises for the first that does not.

    Raises
    ------
    ZeroshotError
        With one sentence that says what is wrong.
    """
    fmu = system.fmu_path
    if not fmu.is_file():
        raise FmuError(f"{fmu}: no such file; the export made no FMU")
    try:
        description = fmpy.read_model_description(str(fmu), validate=True)
    except Exception as error:  # fmpy raises whatever it meets in a broken archive
        raise FmuError(f"{fmu}: fmpy does not read it: {str(error).splitlines()[0]}") from None
    kinds = [
        k for k, v in (("Model Exchange", description.modelExchange), ("Co-Simulation", description.coSimulation)) if v
    ]
    yield f"loads: FMI {description.fmiVersion}, {' and '.join(kinds)}, by {description.generationTool or 'a tool'}"
    if description.modelExchange is None:
        raise FmuError(f"{fmu}: is for {' and '.join(kinds) or 'nothing'}; expected Model Exchange")
    simulator = Simulator(system)
    yield f"variables: {len(system.parameters)} parameters, {len(system.inputs)} inputs, {len(system.outputs)} outputs"
    found = check_live(simulator)
    yield "parameters act, largest change of an output over its accuracy: " + ", ".join(
        f"{name} {change:.0f}" for name, change in found.items()
    )
    if tool is not None:
        rms = differences(system, tool)
        units = {one.name: one.unit for one in system.outputs}
        yield "equals the tool's own simulation, rms: " + ", ".join(f"{n} {v:.2g} {units[n]}" for n, v in rms.items())


def main(argv: list[str] | None = None) -> int:
    """Command line."""
    parser = argparse.ArgumentParser(description="Check an exported FMU.")
    parser.add_argument("fmu", type=Path)
    parser.add_argument("--tool", type=Path, help="CSV of the tool's own simulation of ZeroshotRoom.Verification")
    parser.add_argument("--system", type=Path, default=DEFAULT_SYSTEM, help="system description (default: the twin's)")
    parser.add_argument("--write", type=Path, help="where to write the description with this FMU in it")
    args = parser.parse_args(argv)
    where = args.write or args.fmu.resolve().parent / "system.toml"
    try:
        system = at_fmu(args.system, args.fmu, where)
        for sentence in verify(system, args.tool):
            sys.stdout.write(f"ok      {sentence}\n")
        if args.tool is None:
            sys.stdout.write("skipped the comparison with the tool: no --tool\n")
        if args.write is not None:
            args.write.write_text(_with_fmu(args.system, args.fmu, where), encoding="utf-8")
            sys.stdout.write(f"written {args.write}\n")
    except ZeroshotError as error:
        sys.stderr.write(f"FAILED  {error}\n")
        return 1
    return 0


if __name__ == "__main__":
    sys.exit(main())
