"""Training windows: last observations, following actions, and which of them are padding."""

from dataclasses import dataclass

import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor

from genpolicy.contract.horizons import HorizonConfig
from genpolicy.errors import ContractError, NonFiniteError
from genpolicy.policies.normalisation import Normalisation
from genpolicy.policies.objectives import Batch

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Windows:
    """Training windows in physical units.

    Attributes:
        observations: Shape (M, H_o, D_o).
        actions: Row 0 is the action commanded at the newest observation. Shape (M, K, D_a).
        is_pad: True where an action repeats the last one of its episode. Shape (M, K).
        episodes: Episode of each window; None where nobody asks. Shape (M,).
    """

    observations: Array
    actions: Array
    is_pad: NDArray[np.bool_]
    episodes: NDArray[np.str_] | None = None

    def __post_init__(self) -> None:
        fits = (
            self.observations.ndim == 3
            and self.actions.ndim == 3
            and len(self.observations) == len(self.actions) > 0
            and self.is_pad.shape == self.actions.shape[:2]
            and (self.episodes is None or self.episodes.shape == self.actions.shape[:1])
        )
        if not fits:
            raise ContractError(
                where="training windows",
                found=f"of shapes {self.observations.shape}, {self.actions.shape} "
                f"and {self.is_pad.shape}",
                expected="(M, H_o, D_o), (M, K, D_a) and (M, K) with M > 0, an episode for each",
                action="Build the windows again from the dataset.",
            )
        for name in ("observations", "actions"):
            if not np.isfinite(getattr(self, name)).all():
                raise NonFiniteError(
                    where=f"training windows: {name}",
                    found="not finite",
                    expected="finite numbers",
                    action="Build the dataset again; do not fill gaps.",
                )

    def shortened(self, horizons: HorizonConfig) -> "Windows":
        """The newest H_o observations and first K actions of every window.

        Raises:
            ContractError: The windows are shorter than that.
        """
        oldest, last = horizons.observation_horizon, horizons.prediction_horizon
        if self.observations.shape[1] < oldest or self.actions.shape[1] < last:
            raise ContractError(
                where="training windows",
                found=f"of {self.observations.shape[1]} observations and "
                f"{self.actions.shape[1]} actions",
                expected=f"at least {oldest} and {last}",
                action="Cut the windows with the horizons of params.yaml.",
            )
        return Windows(
            self.observations[:, -oldest:],
            self.actions[:, :last],
            self.is_pad[:, :last],
            self.episodes,
        )


def as_batch(
    windows: Windows, statistics: Normalisation, *, mask_padding: bool, device: str
) -> Batch:
    """Normalised windows as float32 tensors on the device.

    Args:
        windows: Physical units.
        statistics: Of the training split.
        mask_padding: Whether padded actions have weight 0.
        device: `cpu` or a CUDA device.

    Raises:
        ContractError: The windows have other dimensions than the statistics.
    """
    if (windows.observations.shape[2], windows.actions.shape[2]) != (
        statistics.observation.dim,
        statistics.action.dim,
    ):
        raise ContractError(
            where="training windows",
            found=f"of {windows.observations.shape[2]} observation and "
            f"{windows.actions.shape[2]} action numbers",
            expected=f"{statistics.observation.dim} and {statistics.action.dim}, "
            "as in the normalisation",
            action="Use the normalisation of the same dataset.",
        )
    counts = ~windows.is_pad if mask_padding else np.ones_like(windows.is_pad)

    def tensor(values: NDArray[np.generic]) -> Tensor:
        return torch.as_tensor(values.astype(np.float32)).to(device)

    return Batch(
        observations=tensor(statistics.observation.normalise(windows.observations)),
        actions=tensor(statistics.action.normalise(windows.actions)),
        weight=tensor(counts[:, :, None]),
    )
