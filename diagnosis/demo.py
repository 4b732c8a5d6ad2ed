"""The main job from end to end on the default system, command by command, as ``make demo`` runs it."""

from __future__ import annotations

import argparse
import json
import shlex
import shutil
import subprocess
import sys
import time
from pathlib import Path

import xarray as xr
from rich.table import Table

from shared.console import new_console
from shared.system import load_system

console = new_console()
SYSTEM = Path("fmus/MixedAirCO2/system.toml")
MEASURED = ["TRoo", "CO2", "QHea", "mOA", "TDryBul", "HFac", "TSky", "TSet", "time_of_day"]
"""Channels that an engineer has anyway: outputs, actuators, weather, set point, clock."""


def command(*words: str) -> list[str]:
    """A command of ours with the interpreter's own scripts folder, so that it works without activation."""
    return [str(Path(sys.executable).parent / words[0]), *words[1:]]


def show(words: list[str]) -> None:
    """Print a command as a user would type it."""
    console.print(f"$ {shlex.join([Path(words[0]).name, *words[1:]])}", style="bold", markup=False, soft_wrap=True)


def call(*words: str) -> None:
    """Print a command, run it, stop the demo if it fails."""
    full = command(*words)
    show(full)
    code = subprocess.run(full, check=False).returncode
    if code:
        raise SystemExit(code)


def call_side_by_side(*commands: list[str]) -> None:
    """Run commands at the same time, one core each; each one's last lines are printed when it ends."""
    running = []
    for words in commands:
        full = command(*words)
        show(full)
        running.append(subprocess.Popen(full, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True))
    for process in running:
        said, _ = process.communicate()
        console.print("\n".join(said.strip().splitlines()[-3:]), markup=False)
        if process.returncode:
            raise SystemExit(process.returncode)


def compare(recording: Path, predicted: Path) -> Table:
    """The true parameters of a simulated recording beside their estimates."""
    truth = xr.load_dataset(recording)
    found = json.loads(predicted.read_text())["predictions"][0]["parameters"]
    table = Table("parameter", "unit", "true", "estimated", "typical error", box=None)
    for name, one in found.items():
        true = float(truth[name])
        table.add_row(name, one["unit"], f"{true:.4g}", f"{one['value']:.4g}", f"{one['rmse']:.2g}")
    return table


def main() -> None:
    """Run the demo."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--out", type=Path, default=Path("demo"))
    parser.add_argument("--systems", type=int, default=300)
    parser.add_argument("--minutes", type=float, default=3.0, help="training time of the neural estimators")
    options = parser.parse_args()
    out: Path = options.out
    began = time.monotonic()

    def step(number: int, text: str) -> None:
        console.print(f"\n[bold cyan]{number}. {text}[/] [dim]({time.monotonic() - began:.0f} s)[/]")

    if out.exists():
        shutil.rmtree(out)
    out.mkdir(parents=True)
    system = load_system(SYSTEM)
    data, paper, sensors, plain = out / "dataset", out / "paper", out / "sensors", out / "ridge"

    step(1, f"Simulate {options.systems} random rooms for a year of real weather, on all cores")
    call("datagen", "run", str(SYSTEM), "--out", str(data), "--systems", str(options.systems), "--seed", "1")
    call("datagen", "verify", str(data))

    step(2, f"Train two estimators side by side, {options.minutes:g} minutes each: room temperature and CO2 alone")
    console.print("   (the paper's), and with the sensors a building has anyway; then a plain ridge regression")
    channels = ["--channels", *MEASURED]
    budget = ["--minutes", f"{options.minutes:g}", "--context", "168"]
    call_side_by_side(
        ["trainer", "fit", str(data), "--model", "patch-transformer", *budget, "--out", str(paper)],
        ["trainer", "fit", str(data), "--model", "summary-mlp", *budget, *channels, "--out", str(sensors)],
    )
    call("trainer", "fit", str(data), "--model", "ridge", "--context", "168", "--out", str(plain))

    step(3, "Score them: on windows of all rooms (the paper's protocol), and on rooms never trained on")
    for run in (paper, sensors, plain):
        call("trainer", "evaluate", str(run), str(data))

    step(4, "Measure a room that nobody has seen, estimate it, and simulate it with the estimate")
    recording, estimate = out / "recording.nc", out / "estimate.json"
    call("datagen", "simulate", str(SYSTEM), "--seed", "2026", "--hours", "2160", "--out", str(recording))
    words = command("trainer", "predict", str(sensors), str(recording), "--json")
    show(words)
    estimate.write_text(subprocess.run(words, check=True, capture_output=True, text=True).stdout)
    console.print(compare(recording, estimate))
    call("diagnosis", "residuals", str(SYSTEM), str(recording), "--run", str(sensors))

    step(5, "Where everything is")
    for path, what in (
        (data / "README.md", f"the dataset of {system.name}, and how to read it"),
        (paper / "evaluation.md", "R2 of the paper's estimator under both protocols, beside the ceiling"),
        (paper / "scatter.png", "true against estimated parameters"),
        (sensors / "evaluation.md", "the same with more sensors"),
        (sensors / "scatter.png", "true against estimated parameters, with more sensors"),
        (plain / "evaluation.md", "R2 of ridge regression on room temperature and CO2"),
        (estimate, "the estimate of the new room"),
    ):
        console.print(f"   {path}: {what}", markup=False)


if __name__ == "__main__":
    main()
