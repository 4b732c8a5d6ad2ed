"""The main job from end to end on the default system, command by command, as ``make demo`` runs it in a checkout.

Run it at the checkout's root: ``python docs/making/demo.py --out demo``.
"""

from __future__ import annotations

import argparse
import json
import shlex
import shutil
import subprocess
import sys
import time
from itertools import pairwise
from pathlib import Path

import xarray as xr
from rich.table import Table

from shared.console import new_console
from shared.system import System, load_system

console = new_console()
SYSTEM = Path("fmus/MixedAirCO2/system.toml")
SHIPPED = "MixedAirCO2"
"""The pretrained estimator of that system, by name."""
KNOWN = ["TDryBul", "TSky", "winSpe", "HFac", "TSet", "excHea", "excOut", "time_of_day", "day_of_week"]
"""What an engineer knows without a sensor in the room: weather, set point, excitation, clock."""
HIDDEN = "effect.infiltration.cStack=0.004"
"""What the last recording's room does and the model does not: air leaks through its envelope."""


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
        error = "-" if one["rmse"] is None else f"{one['rmse']:.2g}"
        table.add_row(name, one["unit"], f"{true:.4g}", f"{one['value']:.4g}", error)
    return table


def main() -> None:
    """Run the demo."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--out", type=Path, default=Path("demo"))
    parser.add_argument("--systems", type=int, default=1000)
    parser.add_argument("--minutes", type=float, default=2.0, help="training time of the neural estimators")
    options = parser.parse_args()
    out: Path = options.out
    begun: list[float] = []

    def step(number: int, text: str) -> None:
        begun.append(time.monotonic())
        console.print(f"\n[bold cyan]{number}. {text}[/] [dim]({begun[-1] - begun[0]:.0f} s)[/]", markup=True)

    if out.exists():
        shutil.rmtree(out)
    out.mkdir(parents=True)
    system = load_system(SYSTEM)
    data, paper, multiscale = out / "dataset", out / "paper", out / "multiscale"
    shipped, recording, estimate, answer = (
        out / "shipped",
        out / "recording.nc",
        out / "estimate.json",
        out / "diagnosis",
    )

    step(1, f"Simulate {options.systems} random rooms, thirty days each from anywhere in the year, on all cores")
    rooms = ["--preset", "many-rooms", "--systems", str(options.systems), "--seed", "1"]
    call("datagen", "run", str(SYSTEM), "--out", str(data), *rooms)
    call("datagen", "verify", str(data))

    step(2, f"Train two estimators side by side, {options.minutes:g} minutes each: the paper's, and ours")
    console.print("   (ours also reads what is known without a sensor in the room)")
    budget = ["--minutes", f"{options.minutes:g}", "--context", "168"]
    channels = ["--channels", *system.estimator.channels, *KNOWN]
    call_side_by_side(
        ["trainer", "fit", str(data), "--model", "patch-transformer", *budget, "--out", str(paper)],
        [
            "trainer",
            "fit",
            str(data),
            "--model",
            "multiscale-transformer",
            *budget,
            *channels,
            "--out",
            str(multiscale),
        ],
    )

    step(3, "Score them on windows of all rooms (the paper's protocol), and on rooms never trained on")
    for run in (paper, multiscale):
        call("trainer", "evaluate", str(run), str(data))
    console.print("   The estimator that comes with the package has seen many more rooms, and none of these:")
    condition = ["--noise", "none", "--context", "168", "--without", *_others(system)]
    call("trainer", "evaluate", SHIPPED, str(data), *condition, "--out", str(shipped))

    step(4, "Measure a room that nobody has seen, and that leaks, which the model does not know; estimate it")
    simulated = ["--seed", "2027", "--hours", "672", "--set", HIDDEN]
    call("datagen", "simulate", str(SYSTEM), *simulated, "--out", str(recording))
    words = command("trainer", "predict", SHIPPED, str(recording), "--json")
    show(words)
    estimate.write_text(subprocess.run(words, check=True, capture_output=True, text=True).stdout)
    console.print(compare(recording, estimate))

    step(5, "Ask where the recording and the model differ, which effect causes it, and how far the gap shrinks")
    call("diagnosis", "run", str(SYSTEM), str(recording), "--out", str(answer), "--workers", "2")

    step(6, "Where everything is")
    for path, what in (
        (data / "README.md", f"the dataset of {system.name}, and how to read it"),
        (paper / "evaluation.md", "R2 of the paper's estimator under both protocols, beside the ceiling"),
        (multiscale / "evaluation.md", "R2 of ours after the same time"),
        (shipped / "evaluation.md", "R2 of the estimator that comes with the package"),
        (shipped / "scatter.png", "true against estimated parameters"),
        (estimate, "the estimate of the new room"),
        (answer / "report.html", "the diagnosis: open it in a browser"),
    ):
        console.print(f"   {path}: {what}", markup=False)
    names = ("simulation", "training", "scores", "estimate", "diagnosis")
    taken = [f"{name} {after - before:.0f} s" for name, (before, after) in zip(names, pairwise(begun), strict=True)]
    console.print(f"\nIt took {(begun[-1] - begun[0]) / 60:.1f} minutes: {', '.join(taken)}.", markup=False)


def _others(system: System) -> list[str]:
    """Outputs that the default estimator does without."""
    return [name for name in system.output_names if name not in system.estimator.channels]


if __name__ == "__main__":
    main()
