"""Reports that hold as much as a sentence needs."""

from diagnosis.gap.schema import CalibratedBy, Detectability, NamedEffect, ParameterOf, Place, Report, SourceOf, StageOf
from diagnosis.verdicts import Answers, Count


def seen(**smallest):
    return [
        Detectability(name=name, share=0.5, expected=1.0, smallest=size, confusable=[], ratio=0.0, p_value=1.0)
        for name, size in smallest.items()
    ]


def named(name, probability=0.9, *, answer=True, amplitude=2.0, kind="parameter"):
    size = {"amplitude": amplitude, "low": 1.0, "high": 3.0, "unit": "W", "description": f"The {name} leaks"}
    return NamedEffect(name=name, kind=kind, probability=probability, named=answer, **size)


def source(name, verdict, mean):
    size = {"unit": "W", "mean": mean, "peak": 2 * mean, "gain": 9.0, "p_value": 0.005}
    return SourceOf(name=name, description=f"missing {name}", rival="room", balance=5.0, verdict=verdict, **size)


def place(channel, kind="cell", text="room: measured higher"):
    return Place(channel=channel, cell={}, p_value=0.005, kind=kind, text=text, size=1.0, unit="K")


WORTH = Count(what="answers", low=0, high=1, count=50, said=0.9, true=0.8)
CALIBRATED = CalibratedBy(
    **{"system": "room", "made": "2026-01-01", "seed": 7, "hours": 168.0, "noise": "sensor"},
    strata={"none": 50, "listed": 50},
    answers=Answers(alarms=WORTH.model_copy(update={"true": 0.04}), named=WORTH, outside=WORTH),
)

LISTS = ("detectability", "sources", "effects", "sets", "possible", "parameters", "dropped", "shrinkage", "where")
LISTS += ("replayed",)
BARE = (
    {name: [] for name in LISTS}
    | {name: {} for name in ("sources_unknown", "excluded", "assumed")}
    | dict.fromkeys(("replay", "rejected", "unlike", "or_none"), False)
    | dict.fromkeys(("converged", "gap", "chosen_apart"), True)
    | {"verdict": "effect", "occupancy": "measured", "converged_after": None, "mistaken": 0.1, "balance": "none"}
    | {"stages": [None], "calibrated": CALIBRATED, "uncalibrated": ""}
)


def report(**fields):
    return Report.model_construct(**(BARE | fields))


def stage(p_value, where_p, effects=()):
    """``best`` is of the part that is fitted, the p-values are of all readings: they may be of different candidates."""
    found = {"best": "fan", "strongest": "fan", "ratio": 5.0, "evidence": 2.0, "misfit_p": 0.9, "episode_p": 0.5}
    return StageOf(effects=list(effects), p_value=p_value, where_p=where_p, left_over=0.0, **found)


def constant(name, before, after):
    ends = dict.fromkeys(("before_low", "before_high", "after_low", "after_high"), 1.0)
    return ParameterOf(name=name, unit="1", before=before, after=after, at_bound=False, at_bound_after=False, **ends)
