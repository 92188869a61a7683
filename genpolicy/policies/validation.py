"""Validation loss while a policy is trained: fixed held-out windows, fixed noise, by episode.

What is measured twice differs only by what was learned in between: the windows are the same, and
so are the noise, the noise levels and the flow times drawn for them. Nothing is selected or
stopped by it.
"""

import copy

import numpy as np
import torch
from numpy.typing import NDArray

from genpolicy.policies.networks import PolicyNetwork
from genpolicy.policies.objectives import Batch, Objective
from genpolicy.policies.settings import TrainingConfig
from genpolicy.policies.validation_row import ValidationRow, three_quarters
from genpolicy.seeds import integer_seed

VALIDATION_WINDOWS = 1024
EPISODE_WINDOWS = 32


def moments(config: TrainingConfig) -> frozenset[int]:
    """Updates after which the loss of every episode is measured."""
    regular = range(config.validation_every, config.updates + 1, config.validation_every)
    return frozenset((*regular, three_quarters(config.updates), config.updates))


class Validation:
    """Held-out windows that a training is followed on.

    Attributes:
        rows: What was measured by episode so far.
        earlier: The averaged network as it was after `keep_after` updates; None before.
    """

    def __init__(
        self,
        windows: Batch,
        episodes: NDArray[np.str_] | None,
        *,
        seed: int,
        device: str,
        keep_after: int | None = None,
    ) -> None:
        """Choose the windows.

        Args:
            windows: All held-out windows.
            episodes: Episode of each; None follows no episode. Shape (M,).
            seed: Root seed of the training.
            device: Torch device.
            keep_after: Updates after which the network is kept; None keeps none.
        """
        self.rows: list[ValidationRow] = []
        self.earlier: PolicyNetwork | None = None
        self._seed, self._device, self._keep_after = seed, device, keep_after
        stride = max(1, len(windows.actions) // VALIDATION_WINDOWS)
        self._all = _rows(windows, np.arange(0, len(windows.actions), stride)[:VALIDATION_WINDOWS])
        self._by_episode: dict[str, Batch] = {}
        for name in dict.fromkeys(episodes.tolist()) if episodes is not None else ():
            own = np.flatnonzero(episodes == name)
            count = min(len(own), EPISODE_WINDOWS)
            chosen = own[np.linspace(0, len(own) - 1, num=count).round().astype(np.int64)]
            self._by_episode[str(name)] = _rows(windows, chosen)

    def loss(self, network: PolicyNetwork, objective: Objective) -> float:
        """Mean loss over windows of the whole split."""
        return self._loss(network, objective, self._all, "validation_noise")

    def follow(self, updates: int, network: PolicyNetwork, objective: Objective) -> None:
        """Measure every episode after so many updates; keep the network where it is asked for."""
        if updates == self._keep_after:
            self.earlier = copy.deepcopy(network)
        for name, windows in self._by_episode.items():
            loss = self._loss(network, objective, windows, f"validation_noise/{name}")
            self.rows.append(ValidationRow(updates, name, len(windows.actions), loss))

    def _loss(
        self, network: PolicyNetwork, objective: Objective, windows: Batch, noise: str
    ) -> float:
        generator = torch.Generator(device=self._device)
        generator.manual_seed(integer_seed(self._seed, noise))
        with torch.no_grad():
            return float(objective.loss(network, windows, generator))


def _rows(windows: Batch, chosen: NDArray[np.int64]) -> Batch:
    rows = torch.as_tensor(chosen).to(windows.actions.device)
    return Batch(windows.observations[rows], windows.actions[rows], windows.weight[rows])
