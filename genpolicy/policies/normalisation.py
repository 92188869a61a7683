"""Min-max normalisation to [-1, 1] per number, from statistics of the training split only."""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from genpolicy.errors import ContractError, NonFiniteError

Array = NDArray[np.float64]

SMALLEST_RANGE = 1e-6


@dataclass(frozen=True)
class MinMax:
    """Smallest and largest value of each number of a vector, physical units.

    A number whose range is at most 1e-6 is constant: it maps to 0 and back to its middle.

    Attributes:
        minimum: Shape (D,).
        maximum: Shape (D,).
    """

    minimum: Array
    maximum: Array

    def __post_init__(self) -> None:
        low, high = np.array(self.minimum, dtype=float), np.array(self.maximum, dtype=float)
        if low.ndim != 1 or low.shape != high.shape or low.size == 0:
            raise ContractError(
                where="normalisation statistics",
                found=f"of shapes {low.shape} and {high.shape}",
                expected="two vectors of one length",
                action="Build the dataset again.",
            )
        if not (np.isfinite(low).all() and np.isfinite(high).all() and (high >= low).all()):
            raise NonFiniteError(
                where="normalisation statistics",
                found="not finite, or with a minimum above its maximum",
                expected="finite minimum <= maximum",
                action="Build the dataset again.",
            )
        for name, value in (("minimum", low), ("maximum", high)):
            value.flags.writeable = False
            object.__setattr__(self, name, value)

    @property
    def dim(self) -> int:
        """Length of the vector."""
        return len(self.minimum)

    def normalise(self, values: Array) -> Array:
        """Physical values (..., D) to normalised ones; not clipped."""
        half = (self.maximum - self.minimum) / 2.0
        constant = half * 2.0 <= SMALLEST_RANGE
        scaled = (values - self._middle()) / np.where(constant, 1.0, half)
        return np.where(constant, 0.0, scaled)

    def denormalise(self, values: Array) -> Array:
        """Normalised values (..., D) to physical ones."""
        half = (self.maximum - self.minimum) / 2.0
        constant = half * 2.0 <= SMALLEST_RANGE
        return self._middle() + np.where(constant, 0.0, values * half)

    def as_json(self) -> dict[str, list[float]]:
        """The statistics as a JSON object."""
        return {"minimum": self.minimum.tolist(), "maximum": self.maximum.tolist()}

    def _middle(self) -> Array:
        middle: Array = (self.minimum + self.maximum) / 2.0
        return middle


@dataclass(frozen=True)
class Normalisation:
    """Statistics of the observation and of the action.

    Attributes:
        observation: Of the observation vector, D_o numbers.
        action: Of the action, D_a numbers.
    """

    observation: MinMax
    action: MinMax

    def as_json(self) -> dict[str, dict[str, list[float]]]:
        """The statistics as a JSON object."""
        return {"observation": self.observation.as_json(), "action": self.action.as_json()}

    @staticmethod
    def from_json(values: Mapping[str, Any]) -> "Normalisation":
        """The inverse of `as_json`; also reads the dataset manifest's `normalisation`.

        Raises:
            ContractError: A part is missing or not a list of numbers.
        """
        try:
            return Normalisation(
                *(
                    MinMax(
                        np.array(values[part]["minimum"], dtype=float),
                        np.array(values[part]["maximum"], dtype=float),
                    )
                    for part in ("observation", "action")
                )
            )
        except (KeyError, TypeError, ValueError) as error:
            raise ContractError(
                where="normalisation statistics",
                found=f"not readable ({error!r})",
                expected="minimum and maximum of observation and action",
                action="Build the dataset again.",
            ) from error
