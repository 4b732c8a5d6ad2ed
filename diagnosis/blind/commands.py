"""The commands that make, run and score a blind set again: what is sealed for them, and how they are written."""

from __future__ import annotations

import shlex
from pathlib import Path
from typing import Any

from diagnosis.blind.truth import default_truth
from diagnosis.blind.verdicts import LIMIT, Run
from shared.shipped import DESCRIPTION, shipped_systems
from shared.store import sha256_of
from shared.system import System, load_system


def made_of(system: System, truth: Path) -> dict[str, str]:
    """The files that a set is made of, to be sealed with its answers.

    ``system`` is the name of one that comes with the package, or else its file's; ``truth`` the file's name, empty
    where it is the one that is taken if none is given.
    """
    name, same = system.path.name, system
    for shipped, folder in shipped_systems().items():
        if (one := load_system(folder / DESCRIPTION)).canonical() == system.canonical():
            name, same = shipped, one
    digest, usual = sha256_of(truth), default_truth(same)
    is_usual = usual.is_file() and sha256_of(usual) == digest
    return {"system": name, "truth": "" if is_usual else truth.name, "truth_sha256": digest}


def commands(
    opened: dict[str, Any],
    run: Run,
    folder: Path,
    answers: Path,
    results: Path,
    out: Path | None,
    *,
    seed: int,
    count: int,
    leave_one_out: bool,
) -> list[str]:
    """The three commands; leave-one-out only where all had it. Of each path the last part, wherever it was."""
    planned, system = len(opened["recordings"]), _system(opened)
    make = ["make", folder, "--system", system, "--recordings", planned, "--seed", opened["seed"]]
    make += ["--hours", f"{opened['hours']:g}"]
    make += ["--truth", opened["truth"]] if opened.get("truth") else []
    make += ["--answers", answers] if answers.name != f"{folder.absolute().name}.answers.json" else []
    made = ["run", system, folder, "--out", results, "--seed", run.settings.get("seed", 0)]
    made += ["--run", run.settings["estimator"]] if run.settings.get("estimator") else []
    made += ["--without", *run.without] if run.without else []
    limit = run.settings.get("limit", LIMIT)
    made += ["--limit", f"{limit:g}"] if limit != LIMIT else []
    made += ["--leave-one-out"] if leave_one_out else []
    scored = ["score", folder, answers, results, "--out", out or "score.html", "--seed", seed]
    scored += ["--first", count] if count < planned else []
    return [shlex.join(["diagnosis", "blind", *map(_short, one)]) for one in (make, made, scored)]


def _system(opened: dict[str, Any]) -> str:
    """What was sealed; of earlier sets, which say no more than what the system calls itself, the most likely."""
    name = str(opened["system_name"])
    return str(opened.get("system", name if name in shipped_systems() else f"{name}/{DESCRIPTION}"))


def _short(word: object) -> str:
    return word.absolute().name if isinstance(word, Path) else str(word)
