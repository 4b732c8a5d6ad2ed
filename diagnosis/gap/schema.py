"""``report.json`` of ``diagnosis run``: what a program may rely on. The version changes when a field does."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

from pydantic import BaseModel, ConfigDict, Field

from diagnosis.gap.verdict import Verdict
from diagnosis.physics import Finding
from diagnosis.verdicts import Answers
from shared.errors import RecordingError
from shared.reading import newer, read_json, shown, validated
from shared.results import Result

if TYPE_CHECKING:
    import pandas as pd
    from matplotlib.figure import Figure

SCHEMA_VERSION = 18
HOW_FAR = "how far the gap shrinks"
"""Of the steps that a report may lack."""
VERDICTS = {
    "effect": "A cause is found",
    "ambiguous": "Causes that cannot be told apart",
    "none_of_these": "A gap, but none of the candidates explains it",
    "no_gap": "No gap",
    "unfinished": "A gap, whose cause was not looked for to the end",
}
"""What the verdicts are called."""
NOTICED = 0.02
"""Candidates of less probability are told together."""
FEWEST = 12
"""Of fewer scored readings of a channel no share of the gap is given."""


class _Table(BaseModel):
    model_config = ConfigDict(extra="forbid")


class NamedEffect(_Table):
    """One candidate: its probability of being a cause, and, if it was refitted, its size [unit]."""

    name: str
    description: str
    kind: str = Field(description="parameter, shaped, input, sensor, or that of a package's own effect")
    probability: float
    named: bool = Field(description="whether it is part of the answer")
    amplitude: float | None = None
    low: float | None = Field(None, description="end of the 90 % interval [unit]")
    high: float | None = None
    unit: str
    at_bound: bool = False


class HypothesisOf(_Table):
    """The base model or a candidate: log evidences, which compare within a column; null where it was not asked."""

    name: str | None = Field(description="of the candidate; null is the base model")
    on_line: float = Field(description="over the base model's, on the straight line at its fit")
    at_start: float | None = Field(None, description="refitted where the base model's fit began, on one line for all")
    at_best: float | None = Field(None, description="refitted on one line that is drawn where the best of them is")
    amplitude: float | None = Field(None, description="there [scale of the effect]")


class CalibratedBy(_Table):
    """Recordings whose cause was known, by which the probabilities were calibrated, and what answers to them held."""

    system: str
    made: str = Field(description="when [date]")
    seed: int
    hours: float
    strata: dict[str, int] = Field(description="recordings by what they were")
    noise: str
    answers: Answers


class Place(_Table):
    """Where recording and base model differ.

    ``p_value`` is family-wise over all that was looked at; of an offset over a stretch, over all stretches.
    """

    channel: str
    cell: dict[str, str]
    p_value: float
    kind: str
    text: str
    size: float
    unit: str


class ShrinkageOf(_Table):
    """Of one channel, on the days that took no part in the fit that this is of.

    Root mean squares [unit], and the share of the gap above the noise that the chosen effects remove. Shares are
    null where no gap stands out from the noise, or too few ``readings`` on those days to tell; with no readings at all,
    root mean squares are null, too.
    """

    channel: str
    label: str = Field("", description="what the channel is")
    unit: str
    readings: int
    before: float | None = None
    after: float | None = None
    floor: float | None = Field(None, description="of noise alone")
    share: float | None = None
    low: float | None = None
    high: float | None = None
    placebo: float | None = Field(None, description="mean share of placebos")
    placebo_best: float | None = Field(None, description="largest share of a placebo")

    @property
    def told(self) -> tuple[float | None, float | None, float | None]:
        """Share and its interval (share, low, high) as they are told and drawn: at most one.

        Above one, what is left is below the noise that was assumed: all of the gap, and no more.
        """
        share, low, high = (None if x is None else min(x, 1.0) for x in (self.share, self.low, self.high))
        return share, low, high

    @property
    def all_gone(self) -> bool:
        """Whether even the lower end of the interval is told as all of the gap."""
        return self.told[1] is not None and f"{self.told[1]:.0%}" == f"{1:.0%}"

    @property
    def few(self) -> bool:
        """Whether there are too few readings to tell."""
        return self.readings < FEWEST


class ParameterOf(_Table):
    """A parameter as the base model has it, and with the chosen effects, each with its 90 % interval [unit]."""

    name: str
    unit: str
    before: float
    before_low: float
    before_high: float
    after: float | None
    after_low: float | None
    after_high: float | None
    at_bound: bool = Field(description="whether the base model's value lies on its bound")
    at_bound_after: bool


class Detectability(_Table):
    """Of a candidate, before anything is ranked.

    ``share`` of its signature that nuisance and parameters cannot imitate; ``expected`` log-likelihood ratio at one
    scale; ``smallest`` amplitude [unit] that would be seen in nine of ten such recordings; ``confusable``: what a gap
    of that kind, at twice its scale, would be mistaken for, each with an amplitude that it may have; then what was
    found.
    """

    name: str
    share: float
    expected: float
    smallest: float | None
    confusable: list[str]
    ratio: float
    p_value: float


class SourceOf(_Table):
    """A source that a balance may lack [unit], as it would close the residual.

    ``mean`` over the recording and ``peak``, the largest either way; ``gain``: log likelihood over noise alone, and
    ``p_value`` of that; ``balance``: the gain less that of an error of the channel ``rival`` alone; ``verdict``:
    ``balance``, ``sensor``, ``undecided``, or ``none`` where neither explains more than in twins.
    """

    name: str
    description: str
    unit: str
    mean: float
    peak: float
    gain: float
    p_value: float
    rival: str
    balance: float
    verdict: str


class StageOf(_Table):
    """One stage of the search.

    With which effects, and the candidate that stands out most from its own twins (``best``); the largest log Bayes
    factor of a candidate on a straight line (``evidence``) and whose it is (``strongest``), p of the best candidate
    (family-wise), p of the residual's whole square, p of where the residual lies, p of the stretch of one channel that
    reads off the most, and how much log evidence a discrepancy without a cause would still gain: slow or for a while
    (``left_over``).
    """

    effects: list[str]
    best: str | None
    strongest: str | None
    ratio: float
    evidence: float
    p_value: float
    misfit_p: float
    where_p: float | None
    episode_p: float | None
    left_over: float


class NoiseOf(_Table):
    """Noise of the null of one channel: size [unit], slow share of its variance and memory [h]."""

    channel: str
    size: float
    slow_share: float
    hours: float


class Report(Result, _Table):
    """``report.json``."""

    schema_version: int = SCHEMA_VERSION
    physics: list[Finding] = Field(
        [],
        description="what cannot be, or contradicts the description; strong findings first",
    )
    verdict: Verdict
    summary: list[str] = Field(description="the answer in three sentences: where, which, how far and how sure")
    effects: list[NamedEffect] = Field(description="the most probable first")
    hypotheses: list[HypothesisOf] = Field(
        [], description="the base model and all candidates that were tried, by one definition of evidence"
    )
    sets: list[list[str]] = Field(description="for each effect found, the candidates that the data cannot tell apart")
    none_of_these: float = Field(description="probability that the cause is not among the candidates")
    no_gap: float = Field(description="probability that there is no gap")
    mistaken: float = Field(
        description="probability that no cause is among the candidates of the first set: that of none of these, of no"
        " gap, and of the other candidates"
    )
    or_none: bool = Field(description="whether none of the candidates belongs to the set, too")
    possible: list[str] = Field(description="candidates that an answer of none of these does not rule out")
    gap: bool = Field(description="whether tests find a gap, whatever its cause")
    rejected: bool = Field(description="whether the chosen effects are rejected on their own bootstrap replicates")
    unlike: bool = Field(
        description="whether the model is hardly that of the room: a parameter is on its bound, and the nearest"
        " candidate, if any, explains less than is left"
    )
    where: list[Place]
    balance: str = Field(description="whether a balance or a sensor is off: balance, sensor, undecided, none")
    sources: list[SourceOf] = Field(description="what the balances may lack")
    sources_unknown: dict[str, str] = Field(description="sources that could not be worked out, and why")
    shrinkage: list[ShrinkageOf]
    chosen_apart: bool = Field(
        description="whether the readings that were fitted for the shrinkage would alone have chosen the same effects"
    )
    parameters: list[ParameterOf]
    constants: list[ParameterOf] = Field(description="factors of the description's uncertain constants")
    detectability: list[Detectability]
    dropped: list[str] = Field(
        description="without a gap: candidates that explain the recording much better than the base model, fitted from"
        " where its fit began, and that were given up"
    )
    excluded: dict[str, str] = Field(description="candidates that could not be tried, and why")
    failed: dict[str, str] = Field({}, description="candidates whose simulation or algebra failed, and why")
    unfinished: dict[str, str] = Field({}, description="steps that the answer lacks, and why")
    stages: list[StageOf]
    noise: list[NoiseOf]
    limits: list[str]
    system: str
    system_hash: str
    wider: str = Field("", description="the description with wider ranges, if the system names one")
    fmu_sha256: str
    recording: str
    zero: str = Field(
        description="date from which times run, in local standard time: the recording begins at zero + start"
    )
    start: float = Field(description="when the recording begins [s since zero]")
    steps: int
    step: float
    fitted_share: float = Field(description="share of the steps fitted for the shrinkage; the rest was scored on")
    occupancy: str
    replay: bool
    replayed: list[str]
    assumed: dict[str, str]
    twins: int
    seed: int
    started_from: str = Field(description="the estimator whose estimate the base model's fit began with, or prior")
    converged: bool = Field(description="whether the fit of the base model came to rest")
    converged_after: bool | None = Field(
        None,
        description="the same of the fit with what was chosen, by which sizes are told; None without",
    )
    simulations: int
    seconds: float
    cpu_seconds: float
    calibrated: CalibratedBy
    uncalibrated: str = Field("", description="why the probabilities are of another system; empty if they are not")

    @property
    def foremost(self) -> list[NamedEffect]:
        """Candidates worth a line of their own: those of the answer, and others of some probability."""
        return [one for one in self.effects if one.named or one.probability >= NOTICED]

    @property
    def untried(self) -> float:
        """Probability that the cause is a candidate for which there was no time."""
        rest = 1 - self.none_of_these - self.no_gap - sum(one.probability for one in self.effects)
        return rest if self.verdict == "unfinished" and rest > NOTICED else 0.0

    @property
    def others(self) -> tuple[int, float] | None:
        """How many other candidates there are, and their probability together; None where there are none."""
        rest = [one.probability for one in self.effects if not one.named and one.probability < NOTICED]
        return (len(rest), sum(rest)) if rest else None

    @property
    def headline(self) -> str:
        """The recording, and which cause was found."""
        return f"{Path(self.recording).name}: {self.summary[1]}"

    def to_dataframe(self) -> pd.DataFrame:
        """A row for each candidate: its probability, and its size with the 90 % interval if it was fitted."""
        import pandas as pd

        return pd.DataFrame([one.model_dump() for one in self.effects]).set_index("name")

    def plot(self) -> Figure:
        """Probabilities of the foremost candidates, of none of these, and of no gap."""
        from diagnosis.curves import Picture

        chances = {one.name: one.probability for one in self.foremost}
        if self.others is not None:
            chances[f"another of {self.others[0]}"] = self.others[1]
        chances |= {"none of these": self.none_of_these, "no gap": self.no_gap}
        figure = Picture(figsize=(7, 0.6 + 0.35 * len(chances)), layout="constrained")
        axes = figure.subplots()
        axes.barh(list(chances), list(chances.values()), color="#1f5fa8")
        axes.invert_yaxis()
        axes.set(xlim=(0, 1), xlabel="probability")
        return figure


def read_report(path: Path | str) -> Report:
    """Read ``report.json`` of ``diagnosis run``, or the one in a folder.

    Raises
    ------
    RecordingError
        If it is missing, not such a file, or of another version.
    """
    path = Path(path)
    path = path / "report.json" if path.is_dir() else path
    expected = "a file of `diagnosis run`"
    raw = read_json(path, RecordingError, expected)
    version = raw.get("schema_version") if isinstance(raw, dict) else None
    if isinstance(version, int) and version < SCHEMA_VERSION:
        raise RecordingError(
            f"{path}: schema_version is {shown(version)}; expected {SCHEMA_VERSION}, {expected} of this version: run"
            " the diagnosis again"
        )
    if said := newer(SCHEMA_VERSION if version is None else version, SCHEMA_VERSION):
        raise RecordingError(f"{path}: {said}")
    return validated(Report, raw, f"{path}", RecordingError, expected)
