"""The source that would close the residual (missing heat, missing CO2), and whether a balance or a sensor is off.

A missing source acts on the outputs as the model's own sources do; a sensor's error shows on its channel alone, and
imitating it takes a source that looks like a derivative. Both explanations get the same prior; the likelihood
says which is the better.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace

import numpy as np

from diagnosis.where.finding import Finding
from diagnosis.where.inverse import Inverse, decompose
from diagnosis.where.series import DAY, HOUR, Residuals
from diagnosis.where.significance import max_test
from diagnosis.where.source import STRONG, Operator, Source, SourceTest, Verdict, verdict_of
from diagnosis.where.whitened import Whitened, whitened

MEMORIES = (6 * HOUR, 72 * HOUR)
"""Two priors: a source that changes within hours, and one that changes within days [s]."""
SHARES = (0.05, 0.2)
"""Degrees of freedom per pulse at which single pulses are tested: fixed beforehand, not fitted to the recording."""
_MOST_PULSES = 336
_MOVES = 0.05
"""An output is moved by a source when its response, in units of its noise, is this share of the largest."""


def scan_sources(
    residuals: Residuals,
    operators: Sequence[Operator],
    nuisance: np.ndarray | None = None,
    *,
    left: Callable[[np.ndarray], np.ndarray] | None = None,
    alpha: float = 0.05,
) -> SourceTest:
    """Invert the residuals of recording and twins for every source, and weigh sources against sensors.

    Parameters
    ----------
    operators
        One for each source.
    nuisance
        See :func:`~diagnosis.where.whitened.whitened`.
    left
        What calibration leaves of a series on the outputs, (outputs, steps, n) in and out: it has already been applied
        to the residuals, and is to the operators' responses and the sensors' errors. Without it all are as they are.
    """
    white = whitened(residuals, nuisance)
    grouped = [_grouped(one) for one in operators]
    kept = [one.response if left is None else left(one.response) for one in grouped]
    problems = [
        _problems(white, white.response(response), one.edges, (*MEMORIES, 0.0))
        for one, response in zip(grouped, kept, strict=True)
    ]
    sources: list[tuple[Operator, Inverse, float, np.ndarray]] = []
    pulses, source_gains = [], []
    for one, (*smooth, rough) in zip(grouped, problems, strict=True):
        gains, taus = (np.stack(v) for v in zip(*(p.gains() for p in smooth), strict=True))
        best = int(np.argmax(gains[:, 0]))
        source_gains.append(gains.max(axis=0))
        levels = np.stack([p.solve(p.tau_for(share)) for p in smooth for share in SHARES], axis=1)
        pulses.append(levels.reshape(len(levels), -1))
        tau = taus[best, 0] or smooth[best].tau_for(SHARES[0])
        sources.append((one, smooth[best], tau, _roughness(rough)))
    sensors = _sensor_gains(residuals, white, grouped[0].edges, left)
    gains_of_all = np.stack([*source_gains, *sensors.values()], axis=1)
    whole = max_test(np.sqrt(gains_of_all), upper=True)
    pulse_test = max_test(np.concatenate(pulses, axis=1))
    found, offset = [], 0
    for j, (one, problem, tau, ratios) in enumerate(sources):
        width = len(one.edges) - 1
        levels_p = pulse_test.adjusted[offset : offset + pulses[j].shape[1]].reshape(-1, width)
        offset += pulses[j].shape[1]
        solved = problem.solve(tau)
        low, high = np.quantile(solved[1:], [0.025, 0.975], axis=0)
        rival = max((k for k in sensors if k in _moved(white, one)), key=lambda k: float(sensors[k][0]))
        balance = float(source_gains[j][0] - sensors[rival][0])
        sure = min(whole.adjusted[j], whole.adjusted[len(sources) + list(sensors).index(rival)]) <= alpha
        roughness_p = float((1 + np.count_nonzero(ratios[1:] >= ratios[0])) / len(ratios))
        found.append(
            Source(
                name=one.name,
                label=one.label,
                unit=one.unit,
                edges=one.edges,
                estimate=solved[0],
                uncertainty=problem.uncertainty(tau),
                low=low,
                high=high,
                adjusted=levels_p.min(axis=0),
                gain=float(source_gains[j][0]),
                p_value=float(whole.adjusted[j]),
                roughness=float(ratios[0]),
                roughness_p=roughness_p,
                rival=residuals.names[rival],
                balance=balance,
                verdict=verdict_of(balance) if sure else "none",
            )
        )
    by_channel = {residuals.names[k]: float(gains[0]) for k, gains in sensors.items()}
    p_values = dict(zip(by_channel, whole.adjusted[len(sources) :], strict=True))
    suspect = max(by_channel, key=lambda name: by_channel[name])
    done = SourceTest(whole, found, by_channel, suspect if p_values[suspect] <= alpha else None, [])
    return replace(done, findings=_findings(residuals, done, list(sensors), alpha))


def _grouped(operator: Operator) -> Operator:
    """Sum neighbouring pulses until there are few enough to decompose quickly."""
    pulses = operator.response.shape[2]
    size = -(-pulses // _MOST_PULSES)
    if size == 1:
        return operator
    cuts = np.arange(0, pulses, size)
    edges = np.append(operator.edges[:-1][cuts], operator.edges[-1])
    return Operator(
        operator.name, operator.label, operator.unit, np.add.reduceat(operator.response, cuts, axis=2), edges
    )


def _problems(white: Whitened, response: np.ndarray, edges: np.ndarray, memories: Sequence[float]) -> list[Inverse]:
    centres = (edges[1:] + edges[:-1]) / 2
    return [decompose(white.rows, response, centres, memory) for memory in memories]


def _sensor_gains(
    residuals: Residuals, white: Whitened, edges: np.ndarray, left: Callable[[np.ndarray], np.ndarray] | None
) -> dict[int, np.ndarray]:
    """Gains (rows,) by output of an error on that output alone, as free to move as a source is."""
    within = (residuals.middle[:, None] > edges[:-1]) & (residuals.middle[:, None] <= edges[1:])
    found = {}
    for k in white.channels:
        alone = np.zeros((len(residuals.names), *within.shape))
        alone[k] = within
        alone = alone if left is None else left(alone)
        problems = _problems(white, white.response(alone), edges, MEMORIES)
        found[k] = np.max([p.gains()[0] for p in problems], axis=0)
    return found


def _roughness(problem: Inverse) -> np.ndarray:
    """Von Neumann's ratio (1941) of each row's source under a prior that asks for no smoothness, shape (rows,)."""
    solved = problem.solve(problem.tau_for(0.9))
    apart = solved - solved.mean(axis=1, keepdims=True)
    return np.sum(np.diff(apart, axis=1) ** 2, axis=1) / np.maximum(np.sum(apart**2, axis=1), np.finfo(float).tiny)


def _moved(white: Whitened, operator: Operator) -> list[int]:
    """Outputs that a source moves noticeably, in units of their noise: their sensors can be mistaken for it.

    By the source itself: what parameters do to other outputs to make up for it is no reason to suspect their sensors.
    """
    size = {
        k: float(np.linalg.norm(operator.response[k])) / s for k, s in zip(white.channels, white.scales, strict=True)
    }
    return [k for k, one in size.items() if one >= _MOVES * max(size.values())]


def _findings(residuals: Residuals, done: SourceTest, sensors: list[int], alpha: float) -> list[Finding]:
    found: list[Finding] = []
    sources, whole = done.sources, done.test

    def suspected(name: str, against: Source, verdict: Verdict, balance: float) -> None:
        k = list(residuals.names).index(name)
        column = len(sources) + sensors.index(k)
        named = any(f.kind == "sensor" and f.channel == name for f in found)
        if whole.adjusted[column] <= alpha and verdict in ("sensor", "undecided") and not named:
            found.append(
                Finding(
                    kind="sensor",
                    channel=name,
                    label=residuals.labels[k],
                    cell={"against": against.name},
                    p_value=float(whole.adjusted[column]),
                    direction=_words(done, name, against, verdict, alpha),
                    size=-balance,
                    unit="1",
                    t=float(whole.t[column]),
                )
            )

    for j, one in enumerate(sources):
        if one.needed(alpha) and one.verdict in ("balance", "undecided"):
            peak = int(np.argmax(np.abs(one.estimate)))
            day = (one.edges[peak] - one.edges[0]) / DAY
            found.append(
                Finding(
                    kind="source",
                    channel=one.name,
                    label=one.label,
                    cell={"period": f"largest on day {day:.2f}", "first_s": f"{one.edges[peak]:.0f}"},
                    p_value=one.p_value,
                    direction="the model lacks a gain" if one.estimate[peak] > 0 else "the model lacks a loss",
                    size=float(one.estimate[peak]),
                    unit=one.unit,
                    t=float(whole.t[j]),
                )
            )
    for one in sorted(sources, key=lambda one: -one.gain):  # a sensor beside the best of what it can be mistaken for
        suspected(one.rival, one, one.verdict, one.balance)
    if done.suspect is not None:
        most = max(sources, key=lambda one: one.gain)
        balance = most.gain - done.sensor_gains[done.suspect]
        suspected(done.suspect, most, verdict_of(balance), balance)
    return found


def _words(done: SourceTest, sensor: str, against: Source, verdict: Verdict, alpha: float) -> str:
    """What an error of a sensor explains beside a source; and if that is little, what explains the residual better."""
    than = "better than" if verdict == "sensor" else "about as well as"
    said = f"an error of this channel alone explains the residual {than} {against.label}"
    if not against.needed(alpha):
        said += ", of which none is needed"
    better = [one for one in done.sources if one.needed(alpha) and one.gain - done.sensor_gains[sensor] > STRONG]
    if better:
        said += f", but worse than {max(better, key=lambda one: one.gain).label}"
    return said
