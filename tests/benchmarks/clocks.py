"""How often a recording with right clocks is said to have a wrong one, and how often a wrong one is found.

Rooms are made as a blind check makes them: other physics and effects than the model's, persons counted or not, weeks
from all over the year. Of the shifts, readings of temperatures and concentrations are moved, and what leaves the
recording is lost. Intervals of shares are 95 % (Clopper and Pearson).

Run: ``python tests/benchmarks/clocks.py``, and with ``--hours 336 --rooms 120 --shifted 40 --seed 777002``.
"""

from __future__ import annotations

import argparse
import tempfile
from collections import Counter
from dataclasses import replace
from pathlib import Path

import numpy as np
from scipy.stats import beta

from diagnosis.blind.generator import Generator, measured, published, write
from diagnosis.blind.make import ATTEMPTS
from diagnosis.blind.truth import default_truth, load_truth
from diagnosis.physics import check_physics
from diagnosis.recording import HOUR, Recording, read_recording
from shared.errors import SimulationError
from shared.system import System, load_system
from shared.units import TEMPERATURES, spelled

SHIFTS = (1.0, 2.0, 3.0, 5.0, 8.0, 12.0, -8.0)


def shifted(recording: Recording, system: System, hours: float) -> Recording:
    """The recording whose sensors of the room are late."""
    steps, outputs = round(hours * HOUR / recording.step), recording.outputs.copy()
    for row, one in enumerate(system.outputs):
        if spelled(one.unit) in (*TEMPERATURES, "ppm"):
            outputs[row] = np.roll(outputs[row], steps)
            outputs[row, slice(None, steps) if steps > 0 else slice(steps, None)] = np.nan
    return replace(recording, outputs=outputs)


def rooms(system: System, hours: float, seed: int, count: int, folder: Path) -> list[tuple[Recording, bool]]:
    """Recordings, and whether persons were counted."""
    generator = Generator(system, load_truth(default_truth(system), system), hours=hours)
    made = []
    for index in range(count):
        for attempt in range(ATTEMPTS):
            try:
                room = generator.make(seed, index, attempt)
            except SimulationError:
                continue
            outputs, _ = measured(room, generator.system, generator.truth)
            write(folder / f"{index}.nc", published(room, outputs, generator.system, generator.truth))
            made.append((read_recording(folder / f"{index}.nc", system), not room.case.unknown_occupancy))
            break
    return made


def share(hits: int, count: int) -> str:
    """A share with its interval."""
    low = beta.ppf(0.025, hits, count - hits + 1) if hits else 0.0
    high = beta.ppf(0.975, hits + 1, count - hits) if hits < count else 1.0
    return f"{hits} of {count} ({low:.1%} to {high:.1%})"


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--hours", type=float, default=168.0)
    parser.add_argument("--rooms", type=int, default=200)
    parser.add_argument("--shifted", type=int, default=60, help="how many of them are shifted, too")
    parser.add_argument("--seed", type=int, default=777001)
    options = parser.parse_args()
    system = load_system("MixedAirCO2")
    with tempfile.TemporaryDirectory() as folder:
        made = rooms(system, options.hours, options.seed, options.rooms, Path(folder))
    kinds: Counter[str] = Counter()
    for recording, _ in made:
        kinds.update({one.kind if one.strong else f"{one.kind}, a hint" for one in check_physics(system, recording)})
    print("said of recordings as they are")
    for kind, count in {"clock": 0, **kinds}.items():
        print(f"  {kind:24} {share(count, len(made))}")
    print("found within an hour, of readings of the room that are late")
    for hours in SHIFTS:
        for counted in (True, False):
            some = [one for one, told in made[: options.shifted] if told == counted]
            found = [check_physics(system, shifted(one, system, hours)) for one in some]
            hits = sum(any(one.kind == "clock" and abs(one.size - hours) <= 1.0 for one in said) for said in found)
            print(f"  {hours:+5.0f} h, persons {'counted' if counted else 'unknown':8} {share(hits, len(some))}")


if __name__ == "__main__":
    main()
