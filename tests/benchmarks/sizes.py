"""How many 90 % intervals of sizes and parameters cover where one effect acts, and what is said without its candidate.

    python tests/benchmarks/sizes.py MixedAirCO2 --recordings 18 --seed 811287 --out sizes

The rooms are those of the blind check's truth: its FMU has finer walls. The effect acts by its candidate's own law, one
to four of its scales strong. Where it is named, the recording is diagnosed again with its candidate withheld. Take a
seed that nothing was developed on. A recording takes one to four minutes; what is in the folder is not made again.
"""

from __future__ import annotations

import argparse
import json
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

from diagnosis.blind.generator import Generator, measured, published, write
from diagnosis.blind.truth import Strata, default_truth, load_truth
from diagnosis.gap.diagnosed import diagnose
from shared.system import load_system

HOURS = 168.0


def diagnosed(made_by: Generator, seed: int, index: int) -> dict[str, Any]:
    """What was true of a recording, what was named, and which intervals cover."""
    made = made_by.make(seed, index)
    case, system = made.case, made_by.system
    outputs, _ = measured(made, system, made_by.truth)
    with TemporaryDirectory() as folder:
        path = Path(folder) / "recording.nc"
        write(path, published(made, outputs, system, made_by.truth))
        occupancy = "unknown" if case.unknown_occupancy else "measured"
        done = diagnose(system, path, replay=case.replay, occupancy=occupancy, how_far=False, seed=index)
        report = done.report
    true = {cause.label: cause.amplitude for cause in case.causes}
    sizes = [one.low <= true[one.name] <= one.high for one in report.effects if one.named and one.name in true]
    parameters = []
    for one in report.parameters:
        low, high = one.after_low, one.after_high
        low, high = (one.before_low, one.before_high) if low is None or high is None else (low, high)
        parameters.append(low <= made.parameters[one.name] <= high)
    named = [one.name for one in report.effects if one.named]
    withheld = done.without([*true]).report.verdict if {*true} & {*named} else None
    found = {"true": [*true], "verdict": report.verdict, "named": named, "withheld": withheld}
    return found | {"sizes": sizes, "parameters": parameters}


def main() -> None:
    """Diagnose, and print a table."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("system")
    parser.add_argument("--recordings", type=int, default=23)
    parser.add_argument("--seed", type=int, required=True)
    parser.add_argument("--out", type=Path, required=True)
    given = parser.parse_args()
    system = load_system(given.system)
    truth = load_truth(default_truth(system), system).model_copy(
        update={"strata": Strata(none=0, library=1, form=0, two=0, outside=0), "amplitudes": (1.0, 4.0)}
    )
    made_by, rows = Generator(system, truth, hours=HOURS), []
    given.out.mkdir(parents=True, exist_ok=True)
    for index in range(given.recordings):
        path = given.out / f"{given.seed}-{index}.json"
        if not path.exists():
            path.write_text(json.dumps(diagnosed(made_by, given.seed, index)), encoding="utf-8")
        rows.append(json.loads(path.read_text(encoding="utf-8")))
    right = [one for one in rows if {*one["true"]} & {*one["named"]}]
    for what, held in {
        "answers with a name that hold the cause": [one in right for one in rows if one["named"]],
        "sizes of true causes that are covered": [one for row in right for one in row["sizes"]],
        "parameters covered, true cause named": [one for row in right for one in row["parameters"]],
        "parameters covered, all": [one for row in rows for one in row["parameters"]],
        "none of these, the named cause withheld": [one["withheld"] == "none_of_these" for one in right],
    }.items():
        print(f"{what}: {sum(held)} of {len(held)}")


if __name__ == "__main__":
    main()
