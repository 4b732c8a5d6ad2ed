"""A calibration in a few sentences: what the recording identifies, and why not to believe it."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np

from diagnosis.calibrating.schema import Calibration, Parameter
from diagnosis.pages import long_named, within_sentence
from shared.numbers import number
from shared.variables import spaced

POOR = 0.5
"""A model that explains less than this share of what an output did is not believed."""
OUTER = 1.28
"""Beyond this [prior standard deviations] a parameter lies in the outer tenths of its range: no prior left it."""
ROUGH = 1.5
"""Noise of readings so many times the declared one is reported."""
FAR = 2.0
"""Beyond this [prior standard deviations] an uncertain constant is not what the description expects."""


def sentences(report: Calibration) -> list[str]:
    """What came out, in a few sentences; first what speaks against all of it."""
    return [*_lacking(report), *_told(report), *_meant(report)]


def _lacking(report: Calibration) -> list[str]:
    """A fit that had no time, outputs that the model does not follow, and constants that are not the description's."""
    unexplained = [
        f"The fitted model explains {max(one.explained, 0):.0%} of what {name} did: it lacks something, and its"
        " parameters compensate. Trust neither them nor their intervals."
        for name, one in report.outputs.items()
        if one.explained is not None and one.explained < POOR
    ]
    stopped = (
        "The time was up before the fit converged: parameters are those where it stopped, with the intervals of an"
        " optimum. The same command with more --minutes continues from there."
    )
    return [*([stopped] if report.stopped else []), *unexplained, *far_outside(_factors(report))]


def far_outside(factors: Mapping[str, tuple[float, float]], model: str = "") -> list[str]:
    """That uncertain constants are far from what the description expects; nothing where none is.

    Parameters
    ----------
    factors
        By name: what a constant is multiplied by, and the standard deviation of its logarithm in the prior.
    model
        Which model they are of, to begin the sentence with.
    """
    said = [
        f"{name} x{factor:.2g} (expected: x{np.exp(-FAR * relative):.2g} to x{np.exp(FAR * relative):.2g})"
        for name, (factor, relative) in factors.items()
        if is_far(factor, relative)
    ]
    if not said:
        return []
    are, they = ("is", "it") if len(said) == 1 else ("are", "them")
    return [
        f"{model}{', '.join(said)} {are} far outside of what the description expects: do not trust parameters that"
        f" depend on {they}."
    ]


def is_far(factor: float, relative: float) -> bool:
    """Whether a factor is beyond :data:`FAR`; ``relative`` is the prior standard deviation of its logarithm."""
    return bool(abs(np.log(factor)) > FAR * relative)


def _factors(report: Calibration) -> dict[str, tuple[float, float]]:
    """Factors of the uncertain constants, and the prior standard deviations of their logarithms.

    A factor is the exponential of its unknown times that; where it does not differ from one, it says nothing of it.
    """
    places = report.z[len(report.parameters) :]
    return {
        one.name: (one.factor, float(np.log(one.factor) / place))
        for one, place in zip(report.constants, places, strict=False)
        if abs(place) > 0
    }


def _told(report: Calibration) -> list[str]:
    """How well the recording identifies each parameter."""
    groups: dict[str, list[Parameter]] = {"well": [], "partly": [], "hardly": [], "pushed": [], "bound": []}
    for p, place in zip(report.parameters, report.z, strict=False):
        pushed = "pushed" if abs(place) > OUTER else "hardly"
        groups["bound" if p.at_bound else pushed if p.identified == "hardly" else p.identified].append(p)
    them = "it" if len(groups["hardly"]) == 1 else "them"
    hardly = f"It hardly identifies {{}}: what is given for {them} is mostly the prior."
    if not report.converged:  # what still moved is in the interval, so that it looks like a prior that nothing moved
        hardly = f"It hardly identifies {{}}, and the fit did not settle on {them}: values are not the prior's either."
    well = "The recording identifies {} well."
    if any(is_far(*one) for one in _factors(report).values()):
        well = "Only with such constants does the recording identify {} as closely as their intervals say."
    said = [
        words.format(_listed(groups[kind]))
        for kind, words in (
            ("well", well),
            ("partly", "It identifies {} in part."),
            ("hardly", hardly),
            (
                "pushed",
                "It pushes {} to an end of the range: the interval ends where the range does.",
            ),
        )
        if groups[kind]
    ]
    bound = groups["bound"]
    if bound:
        said.append(
            f"{_listed(bound)} {'lies' if len(bound) == 1 else 'lie'} on a bound of the range: either the range is"
            " too narrow, or the model lacks something that the parameter compensates for."
        )
        if report.wider:
            said.append(f"{report.wider} has wider ranges: diagnosis calibrate {report.wider} {report.recording}")
    return said


def _listed(ones: Sequence[Parameter]) -> str:
    """Parameters by what they are, with the names that the model has for them."""
    return ", ".join(long_named(one.name, within_sentence(one.description)) for one in ones)


def _meant(report: Calibration) -> list[str]:
    """What the intervals hold and what not."""
    said = []
    slow = [
        name
        for name, one in report.outputs.items()
        if one.slow_noise > (one.noise if name in report.undeclared else one.declared)
    ]
    if slow:
        said.append(
            f"The residual of {', '.join(slow)} is slow and larger than its sensor's noise: the model lacks something."
        )
    rough = [
        f"{name} ({number(one.noise, 3)}{spaced(one.unit)}, declared {number(one.declared, 3)})"
        for name, one in report.outputs.items()
        if name not in report.undeclared and one.noise > ROUGH * one.declared
    ]
    if rough:
        said.append(
            f"The residual of {', '.join(rough)} scatters from reading to reading by more than its sensor's noise:"
            " either that is declared too small, or the model lacks something fast. Intervals allow for it as noise."
        )
    if report.undeclared:
        taken = ", ".join(f"{name} (to {size})" for name, size in report.undeclared.items())
        said.append(
            f"No noise is declared for the sensor of {taken}: readings were taken to be as exact as the model's"
            " numbers, except for the noise that the fit itself found. Declare it in the description's [[outputs]] as"
            " noise.sensor, or under the preset that --noise names."
        )
    if report.occupancy == "unknown":
        said.append(
            "Occupants were not counted: how many there were was inferred along with the parameters, from the"
            " description's occupancy. What depends on them is as uncertain as that, above all the emission of a"
            " person. Count occupants if the parameters matter."
        )
    if report.replay:
        said.append("Actuators were replayed: errors of their meters drive the model, so take the intervals with care.")
    said.append(
        f"Intervals are up to {report.widened:g} times as wide as the fit makes them, because a building is not the"
        " model. Those of hardly identified parameters are hardly wider, being the prior's. They do not allow for a gap"
        " that the model does not explain."
    )
    if not report.converged:
        said.append(
            "The fit had not converged when it stopped: values are means of its last iterations, and intervals allow"
            " for their remaining movement. Take its figures with care."
        )
    return said
