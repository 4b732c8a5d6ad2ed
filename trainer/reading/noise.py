"""Sensor noise as augmentation: a fresh draw for every window, from the presets of the system description."""

from __future__ import annotations

import torch

from shared.errors import EstimatorError
from shared.system import System
from shared.variables import Noise


def hold_last(values: torch.Tensor, lost: torch.Tensor) -> torch.Tensor:
    """Replace lost readings by the last one that arrived, along dimension 1 of (batch, length, channels).

    Readings lost before the first one arrived are kept as they are: there is nothing to hold.
    """
    place = torch.arange(values.shape[1], device=values.device)[None, :, None].expand_as(lost)
    arrived = torch.where(lost, torch.zeros_like(place), place)
    return torch.gather(values, 1, torch.cummax(arrived, dim=1).values)


class Sensors:
    """The sensors of recorded channels under a preset: Gaussian noise, then quantisation, then dropouts.

    Inputs have no sensors and pass unchanged, and so do outputs that the preset does not mention. Of several presets,
    joined by spaces, each window draws one. Raises EstimatorError if the system has no such preset.
    """

    def __init__(self, system: System, recorded: list[str], preset: str) -> None:
        chosen = []
        for name in preset.split() or [preset]:
            if name not in system.noise_presets:
                raise EstimatorError(
                    f"noise: {name!r} is not a preset of {system.name}; found {', '.join(system.noise_presets)}"
                )
            sensors = {output.name: output.noise.get(name, Noise()) for output in system.outputs}
            chosen.append([sensors.get(channel, Noise()) for channel in recorded])
        # (presets, recorded)
        self.sd = torch.tensor([[n.sd for n in row] for row in chosen])
        self.quantum = torch.tensor([[n.quantum for n in row] for row in chosen])
        self.dropout = torch.tensor([[n.dropout for n in row] for row in chosen])
        self.silent = not any(n.sd or n.quantum or n.dropout for row in chosen for n in row)

    def __call__(self, values: torch.Tensor, generator: torch.Generator) -> torch.Tensor:
        """Readings of the windows ``values`` (batch, length, recorded) [units]; the draw comes from ``generator``."""
        if self.silent:
            return values
        device = values.device
        which = torch.zeros(len(values), dtype=torch.int64, device=device)
        if len(self.sd) > 1:
            which = torch.randint(len(self.sd), (len(values),), generator=generator, device=device)
        sd, quantum, dropout = (part.to(device)[which][:, None, :] for part in (self.sd, self.quantum, self.dropout))
        noisy = values + sd * torch.randn(values.shape, generator=generator, device=device)
        grain = torch.where(quantum > 0, quantum, torch.ones_like(quantum))
        noisy = torch.where(quantum > 0, torch.round(noisy / grain) * grain, noisy)
        lost = torch.rand(values.shape, generator=generator, device=device) < dropout
        return hold_last(noisy, lost)
