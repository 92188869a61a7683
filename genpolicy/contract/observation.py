"""The observation: named channels with unit, size, clock and maximum age."""

from collections.abc import Iterable, Mapping
from dataclasses import asdict, dataclass
from functools import cached_property
from typing import Any, Self

import numpy as np
from numpy.typing import NDArray

from genpolicy.errors import ContractError
from genpolicy.integrity.documents import canonical_json
from genpolicy.integrity.hashing import sha256_bytes

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Channel:
    """One observation channel.

    Attributes:
        name: Name, unit last.
        components: Name of each number.
        unit: SI unit, `1` for a pure number.
        stream: Stream (sensor, with its own clock) that delivers it.
        maximum_age_s: Oldest event that may still condition an invocation, s.
    """

    name: str
    components: tuple[str, ...]
    unit: str
    stream: str
    maximum_age_s: float

    @property
    def size(self) -> int:
        """How many numbers the channel has."""
        return len(self.components)


@dataclass(frozen=True)
class ObservationContract:
    """The ordered channels of one observation vector."""

    channels: tuple[Channel, ...]

    @classmethod
    def of_document(cls, channels: Iterable[Mapping[str, Any]]) -> Self:
        """The contract as a manifest carries it: one mapping of the fields for each channel."""
        return cls(
            tuple(Channel(**{**item, "components": tuple(item["components"])}) for item in channels)
        )

    @property
    def dim(self) -> int:
        """Length of the observation vector."""
        return sum(channel.size for channel in self.channels)

    @cached_property
    def slices(self) -> dict[str, slice]:
        """Where each channel lies in the vector."""
        result, start = {}, 0
        for channel in self.channels:
            result[channel.name] = slice(start, start + channel.size)
            start += channel.size
        return result

    @property
    def component_names(self) -> tuple[str, ...]:
        """`channel.component` of every number of the vector, in order."""
        return tuple(f"{c.name}.{part}" for c in self.channels for part in c.components)

    @property
    def streams(self) -> tuple[str, ...]:
        """Names of the streams, in order of first use."""
        return tuple(dict.fromkeys(channel.stream for channel in self.channels))

    def hash(self) -> str:
        """SHA-256 of the definition."""
        return sha256_bytes(canonical_json([asdict(channel) for channel in self.channels]))

    def join(self, values: dict[str, Array]) -> Array:
        """Vector (..., dim) of one array (..., size) per channel.

        Raises:
            ContractError: A channel is missing, unknown or of another size.
        """
        names = [channel.name for channel in self.channels]
        if set(values) != set(names):
            raise ContractError(
                where="an observation",
                found=f"made of the channels {sorted(values)}",
                expected=f"exactly {sorted(names)}",
                action="Deliver every channel of the observation contract.",
            )
        for channel in self.channels:
            if values[channel.name].shape[-1:] != (channel.size,):
                raise ContractError(
                    where=f"observation channel {channel.name}",
                    found=f"of shape {values[channel.name].shape}",
                    expected=f"a last axis of {channel.size}",
                    action="Deliver the components that the observation contract names.",
                )
        return np.concatenate([values[name] for name in names], axis=-1)
