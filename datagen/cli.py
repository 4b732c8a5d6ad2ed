"""The command ``datagen``: gathers its commands.

A command is a function in a module of its own, a thin shell that returns an exit code; its name, its parameters and its
docstring make the help. To add one, write it and name it here.
"""

from __future__ import annotations

from datagen.commands.compare import compare
from datagen.commands.datasets import copy, info, merge, verify
from datagen.commands.describe import describe
from datagen.commands.identifiability import identifiability
from datagen.commands.run import run
from datagen.commands.simulate import simulate
from shared.console import new_app, start

COMMANDS = (describe, run, simulate, info, verify, copy, merge, identifiability, compare)

app = new_app(
    "datagen",
    "Simulate random systems of an FMU into a dataset that an estimator can learn from.\n\n"
    "A system description (TOML) names the FMU, its parameters, inputs and outputs; `datagen run` makes the dataset.",
)
for _command in COMMANDS:
    app.command(_command)


def main() -> None:
    """Entry point of the console script."""
    raise SystemExit(start(app))


if __name__ == "__main__":
    main()
