"""Where ceilings are kept: among those of the same system, and in place of nothing else."""

from __future__ import annotations

import tempfile
from collections.abc import Iterable, Sequence
from pathlib import Path

from datagen.fmi.fmu import fmu_sha256
from datagen.limits.sensitivities import crowd_inputs
from shared.ceiling import Ceilings, Origin, read_ceilings, unknown_constants
from shared.errors import ZeroshotError
from shared.system import System


def ceilings_at(path: Path, system: System, *, overwrite: bool = False) -> Ceilings:
    """The ceilings of a system that a file holds, to add to; none where there is no file yet.

    To be asked before long work, too: a limit of thirty days takes an hour, and is lost where it cannot be written.

    Parameters
    ----------
    overwrite
        Begin anew where the file's ceilings are of another system, in place of refusing it.

    Raises
    ------
    ZeroshotError
        If nothing can be written there, or what is there is no file of ceilings, or one of another system.
    """
    try:
        with tempfile.NamedTemporaryFile(prefix=f".{path.name}-", dir=path.parent):
            pass
    except OSError as error:
        raise ZeroshotError(
            f"{path}: cannot be written ({error.strerror}); expected a file in a folder that is there and can be"
            " written to"
        ) from None
    none = Ceilings(
        system_name=system.name,
        system_hash=system.hash(),
        fmu_sha256=fmu_sha256(system.fmu_path),
        outputs=system.output_names,
        nuisances=crowd_inputs(system),
    )
    if not path.exists():
        return none
    found = read_ceilings(path)
    for field in ("system_hash", "fmu_sha256"):
        theirs, ours = getattr(found, field), getattr(none, field)
        if theirs == ours:
            continue
        if overwrite:
            return none
        raise ZeroshotError(
            f"{path}: holds limits of {found.system_name} whose {field} is {theirs[:12]}, that of {system.path} is"
            f" {ours[:12]}; expected a file of the same system, another --out, or --overwrite"
        )
    return found


def check_as_many(
    path: Path,
    kept: Ceilings,
    system: System,
    contexts: Iterable[float],
    conditions: Sequence[tuple[str, list[str]]],
    *,
    systems: int,
    uncertain: bool,
) -> None:
    """Refuse to put limits in place of those of more systems, which are surer.

    Parameters
    ----------
    contexts, conditions
        Lengths [h], and noise and channels, of the limits to come.
    systems, uncertain
        Over how many systems they will be, and whether constants are drawn.

    Raises
    ------
    ZeroshotError
        Naming the first condition of which there is one of more systems.
    """
    experiment = system.experiment
    kind = Origin.of(experiment).kind()
    constants = unknown_constants(system.uncertain if uncertain else [])
    for hours in contexts:
        for noise, channels in conditions:
            same = kept.find(
                context_hours=hours, step=experiment.step, noise=noise, channels=channels, constants=constants
            )
            most = max((one.systems for one in same if one.known_origin().kind() == kind), default=0)
            if most > systems:
                raise ZeroshotError(
                    f"{path}: holds a limit for {hours:g} h of {', '.join(channels)} with noise {noise} over {most}"
                    f" systems, and this one is over {systems}; expected --systems {most} or more, another --out, or"
                    " --overwrite"
                )
