"""What every policy offers, learned here or asked over a wire, and what one invocation gives."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from genpolicy.contract.horizons import HorizonConfig
from genpolicy.errors import NonFiniteError
from genpolicy.policies.prefix import Prefix

Array = NDArray[np.float64]
NoiseName = tuple[str | int, ...]


@dataclass(frozen=True)
class Samples:
    """Result of one batched invocation.

    Attributes:
        actions: Candidate chunks, physical units. Shape (B, N, K, D_a).
        nfe: Network evaluations per sample, counted at the network. Where a sampler chooses its
            steps by itself, those of the sample that took most: the calls that its batch waited
            for, which is what the deadline sees.
    """

    actions: Array
    nfe: int

    def finite(self) -> "Samples":
        """The same, for whoever computes with all of them: shares and distances know no NaN.

        Raises:
            NonFiniteError: A number of a chunk is NaN or infinite.
        """
        check_finite(self.actions, "sampled chunks", "Look at the weights; the training diverged.")
        return self


class Policy(Protocol):
    """What every policy offers, learned or scripted."""

    @property
    def method(self) -> str:
        """Name of the method."""

    @property
    def checkpoint_hash(self) -> str:
        """SHA-256 of weights and config."""

    @property
    def sampler_config_hash(self) -> str:
        """SHA-256 of the sampler's settings."""

    @property
    def horizons(self) -> HorizonConfig:
        """Horizons of the method; K = H_e = 1 for methods without chunks."""

    @property
    def prediction_horizon(self) -> int:
        """K, actions of one chunk."""

    @property
    def stochastic(self) -> bool:
        """Whether candidates of one observation differ."""

    @property
    def guided(self) -> bool:
        """Whether its chunks can be drawn to go on from given actions."""

    def sample(
        self,
        observations: Array,
        *,
        noise_names: Sequence[NoiseName],
        candidates: int,
        prefix: Prefix | None = None,
    ) -> Samples:
        """Candidate chunks of physical observations (B, H_o, D_o), one noise name per row.

        `prefix` is what each row's chunks are drawn to go on from; None: nothing.

        A chunk that is not finite comes back as it is: the first layer of feasibility rejects it
        alone, and the others are candidates as before.
        """


def check_finite(values: Array, where: str, action: str) -> None:
    """Refuse numbers that are none.

    Raises:
        NonFiniteError: A number is NaN or infinite; which one, and what to do.
    """
    if not np.isfinite(values).all():
        place = np.argwhere(~np.isfinite(values))[0].tolist()
        raise NonFiniteError(
            where=f"{where}, {place}",
            found=str(values[tuple(place)]),
            expected="a finite number",
            action=action,
        )
