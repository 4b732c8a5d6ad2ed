"""Of what dataset a figure or a fit is, and of what kind its systems are.

Estimators and their figures hold for systems such as those they are of: of a season, with or without excitation, with
constants of the description as declared or drawn.
"""

from __future__ import annotations

from pydantic import BaseModel

from shared.store import DatasetFolder, Records
from trainer.reading.data import digest_of, identity_of


class Kind(BaseModel, extra="forbid"):
    """A dataset, and what its systems have in common."""

    root_seeds: list[int]
    """rising; a merged dataset has several"""
    systems: int
    start: tuple[float, float]
    """a record begins at a midnight between these hours of the year [h]"""
    hours: float
    """length of a record [h]"""
    excitation: bool
    """whether inputs of source ``excitation`` act"""
    calm: float
    """share of the systems in which they do not all the same"""
    held: list[str]
    """uncertain constants of the description that all systems have as declared"""
    drawn: list[str]
    """those that are drawn for each system"""
    fingerprint: str | None = None
    """sha256 of which systems these are and how they were simulated; None where it was not noted"""

    @classmethod
    def of(cls, dataset: DatasetFolder, index: Records) -> Kind:
        """The kind of a dataset; ``index`` are the records of all its systems, of whatever channels."""
        settings, experiment = dataset.manifest.settings, dataset.system.experiment
        constants = [one.name for one in dataset.system.uncertain]
        drawn = "uncertain" in settings
        return cls(
            root_seeds=sorted({int(seed) for seed in index.seeds}),
            systems=len(index.systems),
            start=experiment.start,
            hours=experiment.hours,
            excitation=bool(settings.get("excitation", True)),
            calm=float(settings.get("calm", 0.0)),
            held=[] if drawn else constants,
            drawn=constants if drawn else [],
            fingerprint=digest_of(identity_of(dataset, index)),
        )

    def _seeds(self) -> str:
        return f"root {'seed' if len(self.root_seeds) == 1 else 'seeds'} {', '.join(map(str, self.root_seeds))}"

    def heading(self) -> str:
        """The same in few words, for a heading: what tells most figures apart."""
        seeds = self._seeds()
        constants = "constants drawn" if self.drawn else "constants as declared" if self.held else ""
        calm = "no excitation" if not self.excitation else f"{self.calm:g} without excitation" if self.calm else ""
        return ", ".join(one for one in (seeds, constants, calm) if one)

    def sentence(self) -> str:
        """Of what dataset something is, in words."""
        facts = [f"{self.systems} systems of {self._seeds()}", f"records of {self._season()}", self._excited()]
        if self.held:
            facts.append(f"{', '.join(self.held)} as declared")
        if self.drawn:
            facts.append(f"{', '.join(self.drawn)} drawn for each system")
        if self.fingerprint is not None:
            facts.append(f"fingerprint {self.fingerprint[:12]}")
        return "dataset: " + "; ".join(facts)

    def unlike(self, other: Kind) -> list[str]:
        """In what the systems of this dataset are of another kind than those of another one, but for constants."""
        pairs = ((self._season(), other._season()), (self._excited(), other._excited()))
        return [f"{own}, not {theirs}" for own, theirs in pairs if own != theirs]

    def _season(self) -> str:
        first, last = self.start
        begin = f"hour {first:g}" if first == last else f"hours {first:g} to {last:g}"
        return f"{self.hours:g} h from {begin} of the year"

    def _excited(self) -> str:
        if not self.excitation:
            return "without excitation"
        return f"a share of {self.calm:g} without excitation" if self.calm else "excited where the system can be"
