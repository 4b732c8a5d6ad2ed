"""Whether the candidates of a diagnosis begin where the base model is: at zero they must not jump."""

from __future__ import annotations

from collections.abc import Iterable

from datagen.fmi.baselines import check_baseline
from datagen.fmi.fmu import Fmu
from diagnosis.effects.asked import check_parameters
from diagnosis.effects.base import Effect
from diagnosis.effects.kinds import DeclaredKind, FmuParameters
from shared.system import System


def check_baselines(effects: Iterable[Effect], system: System, fmu: Fmu, *, replay: bool) -> None:
    """Refuse effects whose parameters at an amplitude of zero are not those of the base model.

    Those of the description have been held against its FMU when that was loaded; a caller or a package may bring
    others. Effects that cannot act in this mode are not looked at. Those of other kinds that a package may have may
    follow any law, but must set what can be set: see :func:`~diagnosis.effects.asked.check_parameters`.

    Parameters
    ----------
    replay
        Whether the recorded actuators replace the control loops: the description's [replay] counts then.

    Raises
    ------
    SystemDescriptionError
        For the first parameter that the FMU does not have or cannot set, or that has another value in the base model.
    """
    mode = "replay" if replay else "control"
    for effect in effects:
        if isinstance(effect, FmuParameters) and mode in effect.spec.modes:
            check_baseline(effect.spec, system, fmu, replay=replay)
        elif not isinstance(effect, DeclaredKind):
            check_parameters(effect, system, fmu)
