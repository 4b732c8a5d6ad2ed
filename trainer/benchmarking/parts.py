"""The tables and figures of the benchmark, each a list of conditions, from the system description and the dataset."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Literal

from shared.errors import EstimatorError
from shared.refused import meant
from shared.system import System
from shared.variables import WeatherInput
from trainer.benchmarking.conditions import Condition
from trainer.models import option_defaults
from trainer.reading.encoding import DERIVED

PAPERS = "patch-transformer"
"""The paper's estimator."""
PATCHES = (4, 12, 24)
"""Table 3 [samples]."""
COMPARED = (24.0, 72.0, 168.0)
"""Contexts of Table 4 [h]."""
BASELINES = (PAPERS, "lstm", "tcn")
HONEST = ("mean", "ridge")
SCATTER = 48.0
"""Context of Figure 4 [h]."""
CONTEXTS = (24.0, 48.0, 96.0, 168.0, 360.0, 720.0)
"""Contexts of Figure 5 [h]."""
WEEK = 168.0
COUNTS = (80, 400, 2000)
"""Training systems; all are added."""

Picture = Literal["scores", "scatter", "accuracy", "systems"]


@dataclass(frozen=True)
class Row:
    """One line of a table: what it is called, under the part's heads, and what is fitted for it."""

    labels: tuple[str, ...]
    condition: Condition


@dataclass
class Part:
    """A table and its figure."""

    name: str
    title: str
    text: str
    heads: tuple[str, ...]
    picture: Picture
    rows: list[Row] = field(default_factory=list)
    notes: list[str] = field(default_factory=list)

    def add(self, labels: tuple[str, ...], condition: Condition) -> None:
        """One more line."""
        self.rows.append(Row(labels, condition))


@dataclass(frozen=True)
class Ground:
    """What the parts are made from."""

    system: System
    hours: float
    """length of the records [h]"""
    step: float
    """[s]"""
    training: int
    """training systems"""
    ours: tuple[str, ...]
    """estimators that stand beside the paper's"""

    @property
    def channels(self) -> tuple[str, ...]:
        """What an estimator reads unless the part says otherwise."""
        return tuple(self.system.estimator.channels)

    def lacks(self, hours: float) -> str | None:
        """Why a context cannot be had, or None."""
        if hours > self.hours:
            return f"context {hours:g} h is skipped: the dataset's records are {self.hours:g} h long"
        if abs(hours * 3600 / self.step - round(hours * 3600 / self.step)) > 1e-6:
            return f"context {hours:g} h is skipped: it is not a whole number of steps of {self.step:g} s"
        return None

    def week(self) -> float:
        """Seven days, or all that the records have."""
        return min(WEEK, self.hours)


def channel_sets(system: System) -> dict[str, tuple[str, ...]]:
    """What may be measured, from little to much: nothing but the description's roles says what a channel is."""
    base = tuple(system.estimator.channels)
    weather = [one.name for one in system.inputs if isinstance(one, WeatherInput) and one.name not in base]
    clock = [name for name in DERIVED if name not in (*system.input_names, *system.output_names)]
    further = [name for name in system.output_names if name not in base]
    known = (*base, *weather, *clock)
    what = " and ".join(["weather"] * bool(weather) + ["clock"] * bool(clock))
    sets = {" ".join(base): base}
    if len(known) > len(base):
        sets[f"+ {what}"] = known
    if len(further) > 1:
        sets |= {f"+ {what}, {name}" if what else f"+ {name}": (*known, name) for name in further}
    if further:
        sets[f"+ {what}, all outputs" if what else "+ all outputs"] = (*known, *further)
    return sets


def _table3(ground: Ground) -> Part:
    part = Part(
        "table3",
        "Table 3: patch size",
        f"The paper's estimator; patches of {', '.join(map(str, PATCHES))} samples, {ground.week():g} h of context.",
        ("patch",),
        "scores",
    )
    for patch in PATCHES:
        if patch * ground.step > ground.week() * 3600:
            part.notes.append(f"patch {patch} is skipped: it is longer than the context")
            continue
        own = patch == option_defaults(PAPERS)["patch"]
        part.add(
            (str(patch),),
            Condition(
                model=PAPERS,
                context_hours=ground.week(),
                channels=ground.channels,
                patch=None if own else patch,
            ),
        )
    return part


def _table4(ground: Ground) -> Part:
    part = Part(
        "table4",
        "Table 4: estimators and context",
        "Every estimator with the same budget of steps or minutes, and its own number of windows a step; `mean` looks"
        " at nothing, `ridge` is linear in summary statistics.",
        ("context [h]", "estimator"),
        "scores",
    )
    for hours in COMPARED:
        if why := ground.lacks(hours):
            part.notes.append(why)
            continue
        for model in dict.fromkeys([*BASELINES, *ground.ours, *HONEST]):
            labels = (f"{hours:g}", model)
            part.add(labels, Condition(model=model, context_hours=hours, channels=ground.channels))
    return part


def _figure4(ground: Ground) -> Part:
    part = Part(
        "figure4",
        "Figure 4: estimates against the truth",
        f"{SCATTER:g} h of context; the pictures show the first seed.",
        ("estimator",),
        "scatter",
    )
    if why := ground.lacks(SCATTER):
        part.notes.append(why)
        return part
    for model in dict.fromkeys([PAPERS, *ground.ours]):
        part.add((model,), Condition(model=model, context_hours=SCATTER, channels=ground.channels))
    return part


def _figure5(ground: Ground) -> Part:
    part = Part(
        "figure5",
        "Figure 5: relative accuracy against context",
        "Relative accuracy is 1 - |p - estimate| / p; the table gives R2 and the median of it. The boxes of the"
        " pictures are of all seeds, too; outliers are not drawn.",
        ("estimator", "context [h]"),
        "accuracy",
    )
    for model in dict.fromkeys([PAPERS, *ground.ours]):
        for hours in CONTEXTS:
            if why := ground.lacks(hours):
                part.notes += [why] if why not in part.notes else []
                continue
            part.add((model, f"{hours:g}"), Condition(model=model, context_hours=hours, channels=ground.channels))
    return part


def _systems(ground: Ground) -> Part:
    part = Part(
        "systems",
        "R2 against the number of training systems",
        f"{ground.week():g} h of context. Under `paper` the full dataset is what was trained on and as large a part of"
        " the others; `unseen` scores the same test systems in every line. Weights are always chosen on all validation"
        " systems.",
        ("estimator", "training systems"),
        "systems",
    )
    for model in dict.fromkeys([PAPERS, *ground.ours, "ridge"]):
        for count in COUNTS:
            if count >= ground.training:
                note = f"{count} systems are skipped: the dataset has {ground.training} training systems"
                part.notes += [note] if note not in part.notes else []
                continue
            part.add((model, str(count)), _of_week(ground, model, systems=count))
        part.add((model, str(ground.training)), _of_week(ground, model))
    return part


def _channels(ground: Ground) -> Part:
    part = Part(
        "channels",
        "What each added sensor buys",
        f"{ground.week():g} h of context, noise-free. The weather is what the systems were simulated with; the ceiling"
        " takes it for known in every line.",
        ("estimator", "channels"),
        "scores",
    )
    sets = channel_sets(ground.system)
    if len(sets) == 1:
        part.notes.append("the system description has no channel that the estimator does not read already")
    for model in ground.ours:
        for label, channels in sets.items():
            part.add((model, label), _of_week(ground, model, channels=channels))
    return part


def _noise(ground: Ground) -> Part:
    part = Part(
        "noise",
        "Sensor noise",
        f"{ground.week():g} h of context; trained and scored with the same preset of the system description.",
        ("estimator", "channels", "noise"),
        "scores",
    )
    presets = ground.system.noise_presets
    if len(presets) == 1:
        part.notes.append("the system description has no sensor preset")
    sets = channel_sets(ground.system)
    few, many = next(iter(sets.items())), list(sets.items())[-1]
    lines = [(PAPERS, *few), *((model, *few) for model in ground.ours)]
    lines += [(model, *many) for model in ground.ours] if many != few else []
    for model, label, channels in dict.fromkeys(lines):
        for preset in presets:
            part.add((model, label, preset), _of_week(ground, model, channels=channels, noise=preset))
    return part


def _of_week(
    ground: Ground, model: str, *, channels: tuple[str, ...] = (), noise: str = "none", systems: int | None = None
) -> Condition:
    hours = ground.week()
    return Condition(
        model=model, context_hours=hours, channels=channels or ground.channels, noise=noise, systems=systems
    )


PARTS = {
    "table3": _table3,
    "table4": _table4,
    "figure4": _figure4,
    "figure5": _figure5,
    "systems": _systems,
    "channels": _channels,
    "noise": _noise,
}


def make_parts(ground: Ground, names: list[str] | None) -> list[Part]:
    """The parts of these names, all by default.

    Raises EstimatorError if a name is unknown, or none is given.
    """
    if names is not None and not names:
        raise EstimatorError(f"parts: none is named; expected some of {', '.join(PARTS)}")
    for name in names or []:
        if name not in PARTS:
            raise EstimatorError(f"parts: {name!r} is unknown; found {', '.join(PARTS)}{meant(name, PARTS)}")
    return [make(ground) for name, make in PARTS.items() if names is None or name in names]
