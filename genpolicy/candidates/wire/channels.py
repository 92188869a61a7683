"""Where the channels that an entry names stand in the observation."""

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from genpolicy.candidates.wire.entry import Entry
from genpolicy.contract.observation import ObservationContract
from genpolicy.errors import ContractError

Indices = NDArray[np.int64]


def columns_of(names: Sequence[str], contract: ObservationContract, *, where: str) -> Indices:
    """Where channels, or single numbers of them, stand in the observation vector.

    Raises:
        ContractError: One of them does not exist.
    """
    single = {name: column for column, name in enumerate(contract.component_names)}
    found: list[int] = []
    for name in names:
        if name in contract.slices:
            part = contract.slices[name]
            found += range(part.start, part.stop)
        elif name in single:
            found.append(single[name])
        else:
            raise ContractError(
                where=f"{where} of the candidate",
                found=repr(name),
                expected=f"a channel ({', '.join(contract.slices)}) or `channel.component` of one",
                action="Name what the observation contract holds.",
            )
    return np.array(found, dtype=np.int64)


def widths_of(entry: Entry, contract: ObservationContract) -> dict[str, int]:
    """How many numbers each input of an entry has, by name.

    Raises:
        ContractError: It names what the observation does not have.
    """
    return {
        name: len(columns_of(part.channels, contract, where=f"observation.{name}"))
        for name, part in entry.observation.items()
    }
