"""One interface for every monitor: what it is fitted on, what it scores, and when it cannot."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from genpolicy.contract.normalisation import Normalisation
from genpolicy.policies.policy import NetworkPolicy
from genpolicy.policies.windows import Windows

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Invocation:
    """What one invocation of a policy saw and drew.

    Attributes:
        time_s: When it began, from the start of its episode, s.
        observations: What it was conditioned on, newest last. Shape (H_o, D_o).
        chunks: Its candidates, row 0 at `time_s`. Shape (N, K, D_a).
        before: The invocation before it in the same episode; None of the first.
    """

    time_s: float
    observations: Array
    chunks: Array
    before: "Invocation | None" = None


@dataclass(frozen=True)
class Fit:
    """What a monitor may learn from: nothing that was held out.

    Attributes:
        windows: Windows of the successful training episodes.
        normalisation: Of the training split.
        action_period_s: Time from one row of a chunk to the next, s.
        policy: The policy that is watched; None where its weights are not known here.
        others: The same method from other training seeds.
        candidates: How many an invocation draws.
    """

    windows: Windows
    normalisation: Normalisation
    action_period_s: float
    policy: NetworkPolicy | None = None
    others: Sequence[NetworkPolicy] = ()
    candidates: int = 1


@dataclass(frozen=True)
class Unavailable:
    """Why a monitor cannot watch a policy."""

    why: str


class Monitor(Protocol):
    """One way to say how far out an invocation is."""

    def score(self, invocation: Invocation) -> float:
        """Higher is further out; finite."""
        ...


NO_WEIGHTS = Unavailable("the weights of a policy that was brought are not known here")
