"""What is known of a building beside its readings: given facts and parameters, as static inputs that may be unknown.

An encoded window carries them as constant columns behind the others: first the value of each fact, standardised, 0
where it is unknown; then whether it is known, 1 or 0. In training a random part is revealed, so that an estimator
reads whatever a user happens to know, and answers a parameter that is known with its value.
"""

from __future__ import annotations

from typing import Literal

import torch

UNKNOWN = 0.4
"""Share of the training's windows in which no parameter is revealed."""
MOST = 0.8
"""Largest probability with which each of them is revealed in the others."""
ALL_GIVEN, NONE_GIVEN = 0.35, 0.15
"""Shares of the training's windows in which all given facts are known, and none."""

Known = Literal["random", "given", "nothing"]


class Reveal:
    """Which facts of windows are known: ``random`` as in training, ``nothing``, or ``given`` facts as of a plan.

    ``parameters`` and ``given`` are numbers of facts: those that are estimated parameters, which come first, and given
    ones.
    """

    def __init__(self, parameters: int, given: int, known: Known = "random") -> None:
        self.parameters, self.given, self.known = parameters, given, known

    def __call__(self, facts: torch.Tensor, generator: torch.Generator) -> torch.Tensor:
        """Static columns (windows, 2 facts) of standardised facts (windows, facts)."""
        count, device = len(facts), facts.device

        def draw(*shape: int) -> torch.Tensor:
            return torch.rand(shape, generator=generator, device=device)

        if self.known == "random":
            odds = torch.where(draw(count, 1) < UNKNOWN, 0.0, MOST * draw(count, 1))
            parameters = draw(count, self.parameters) < odds
            u = draw(count, 1)
            odds = torch.where(u < ALL_GIVEN, 1.0, torch.where(u < ALL_GIVEN + NONE_GIVEN, 0.0, draw(count, 1)))
            given = draw(count, self.given) < odds
        else:
            parameters = torch.zeros((count, self.parameters), dtype=torch.bool, device=device)
            given = torch.full((count, self.given), self.known == "given", device=device)
        return static_columns(facts, torch.cat([parameters, given], dim=1))


def static_columns(facts: torch.Tensor, known: torch.Tensor) -> torch.Tensor:
    """Static columns (windows, 2 facts) of standardised facts (windows, facts) and whether each is known, bool."""
    flags = known & torch.isfinite(facts)
    return torch.cat([facts.masked_fill(~flags, 0.0), flags.to(facts.dtype)], dim=1)


def with_static(windows: torch.Tensor, static: torch.Tensor) -> torch.Tensor:
    """Encoded windows (windows, length, columns) with static columns (windows, 2 facts) behind the others."""
    return torch.cat([windows, static[:, None].expand(-1, windows.shape[1], -1)], dim=2)


def known_parameters(windows: torch.Tensor, static: int, parameters: int) -> tuple[torch.Tensor, torch.Tensor]:
    """Of encoded windows, which parameters are known and their standardised values, (windows, parameters) each.

    ``static`` is the number of static columns, ``parameters`` that of facts which are parameters.
    """
    columns = windows[:, 0, windows.shape[2] - static :]
    known, values = columns[:, static // 2 : static // 2 + parameters] > 0, columns[:, :parameters]
    return known, values
