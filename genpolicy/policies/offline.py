"""Offline evaluation: distance of one sampled chunk to the demonstrated one, per task phase.

These errors describe, they do not decide: with several valid actions, a policy that reproduces
all of them is further from any single demonstration than their mean is.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from genpolicy.contract.action import POSITION
from genpolicy.errors import ContractError
from genpolicy.policies.normalisation import Normalisation
from genpolicy.policies.protocol import NoiseName, Policy
from genpolicy.policies.windows import Windows


@dataclass(frozen=True)
class OfflineError:
    """Errors of one phase of one split.

    Attributes:
        phase: Task phase of the newest observation.
        windows: How many windows were compared.
        masked_mae: Mean absolute error of the actions that are not padding, normalised units.
        position_rmse_m: Root mean square distance of the TCP positions, m.
    """

    phase: str
    windows: int
    masked_mae: float
    position_rmse_m: float


def numbers_or_nan(chunks: NDArray[np.float64]) -> NDArray[np.float64]:
    """Chunks (B, K, D_a) with infinity as NaN, which no arithmetic behind it warns of."""
    return np.where(np.isfinite(chunks), chunks, np.nan)


def masked_errors(
    policy: Policy,
    windows: Windows,
    *,
    phases: NDArray[np.str_],
    normalisation: Normalisation,
    noise_names: list[NoiseName],
) -> list[OfflineError]:
    """Errors of one candidate per window, grouped by phase.

    A chunk that is no numbers makes the errors of its phase NaN: a mean over the others would
    flatter.

    Args:
        policy: The policy; its K may be shorter than the windows' chunks.
        windows: Windows of one split, physical units. M windows.
        phases: Phase of each window. Shape (M,).
        normalisation: Statistics of the training split, the unit of `masked_mae`.
        noise_names: Noise name of each window. Length M.

    Returns:
        One entry per phase that occurs, sorted by name.

    Raises:
        ContractError: Lengths that differ.
    """
    count = len(windows.observations)
    if len(phases) != count or len(noise_names) != count:
        raise ContractError(
            where="offline evaluation",
            found=f"{count} windows, {len(phases)} phases and {len(noise_names)} noise names",
            expected="one of each per window",
            action="Pass the columns of the same windows.",
        )
    horizon = policy.prediction_horizon
    sampled = policy.sample(windows.observations, noise_names=noise_names, candidates=1)
    predicted, target = numbers_or_nan(sampled.actions[:, 0]), windows.actions[:, :horizon]
    counts = ~windows.is_pad[:, :horizon]
    scale = normalisation.action
    absolute = np.abs(scale.normalise(predicted) - scale.normalise(target)).mean(axis=-1)
    squared = np.square(predicted[..., POSITION] - target[..., POSITION]).sum(axis=-1)
    results = []
    for phase in sorted(set(phases.tolist())):
        inside = (phases == phase)[:, None] & counts
        results.append(
            OfflineError(
                phase=str(phase),
                windows=int(inside.any(axis=1).sum()),
                masked_mae=float(absolute[inside].mean()) if inside.any() else float("nan"),
                position_rmse_m=float(np.sqrt(squared[inside].mean()))
                if inside.any()
                else float("nan"),
            )
        )
    return results
