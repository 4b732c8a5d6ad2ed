"""The command ``trainer info``."""

from __future__ import annotations

import json as json_
import sys
from pathlib import Path
from typing import Annotated, Any

from cyclopts import Parameter
from rich.table import Table

from shared.console import new_console


def info(run: Path, /, *, json: Annotated[bool, Parameter(negative="")] = False) -> None:
    """Say what a run folder holds, and verify that it loads.

    Parameters
    ----------
    run
        Run folder made by `trainer fit`, or the name of a system that comes with an estimator.
    json
        Print estimator.json on stdout, with a sentence `unfinished` where the training did not come to its end, or
        another run is at work in the folder (null where neither is so).
    """
    from trainer.runs.checkpoint import load_run
    from trainer.runs.unfinished import unfinished
    from trainer.runs.validation import whole_condition

    loaded = load_run(run)
    card = loaded.card
    cut_short = unfinished(card, loaded.folder)
    if json:
        found = json_.loads(card.model_dump_json()) | {"unfinished": cut_short}
        sys.stdout.write(json_.dumps(found, indent=1, ensure_ascii=False) + "\n")
        return
    weights = sum(tensor.numel() for tensor in loaded.model.parameters())
    done = card.training
    seeds = ", ".join(map(str, sorted(set(card.training_systems.root_seeds))))
    rows: list[tuple[str, Any]] = [
        ("model", f"{card.model} {card.options}, {weights} weights"),
        ("system", f"{card.system_name} ({card.system_hash[:12]})"),
        ("reads", f"{card.context_hours:g} h of {', '.join(card.encoding.channels)}, step {card.encoding.step:g} s"),
        ("noise", card.noise),
        ("trained on", f"{len(card.training_systems.indices)} systems of root seed {seeds}"),
        ("training", f"step {done.best_step} of {done.steps}, {done.batch_size} windows each, {done.seconds:g} s"),
        ("validation loss", done.loss_text()),
        ("rmse below", f"of its validation windows: {whole_condition(card)}"),
    ]
    for name, unit in zip(card.encoding.parameters, card.encoding.parameter_units, strict=True):
        rows.append((name, f"+- {card.validation_rmse[name]:.3g} {unit}"))
    table = Table(show_header=False)
    for name, value in rows:
        table.add_row(name, str(value))
    console = new_console()
    console.print(table)
    if cut_short:
        console.print(cut_short, markup=False)
