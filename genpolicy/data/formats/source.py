"""What every importer offers: named columns, and the episodes one after the other.

An importer only reads. What its columns mean is the contract's business, and whether an episode
is good enough is decided in one place for all of them (`accept`).
"""

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, field
from typing import Any, Literal, NoReturn, Protocol

import numpy as np
from numpy.typing import NDArray

from genpolicy.data.assemble import Refusal
from genpolicy.data.formats.contract import ImportContract, Labels
from genpolicy.errors import BadInputError, ContractError

MAXIMUM_EPISODE_ROWS = 1_000_000
MAXIMUM_SOURCE_ROWS = 50_000_000
MAXIMUM_VALUE_BYTES = 2 << 30
# What nothing depends on is read beside the rest as long as all of an episode is no larger.
MAXIMUM_BESIDE_BYTES = 128 << 20
TOO_LARGE = f"beside the others more than {MAXIMUM_BESIDE_BYTES >> 20} MiB an episode"
NOT_READABLE = "not readable"
ACTION = "Correct the recording, or leave this episode out."

Progress = Callable[[int, int | None], None]


@dataclass(frozen=True)
class Column:
    """One column of the recordings.

    Attributes:
        name: Name, as the contract cites it.
        width: How many numbers a row has; None for a scalar column.
        kind: Numbers, or text (flags count as numbers 0 and 1).
        components: Names of the numbers, where the recordings give them.
        unit: Unit, where the recordings state it.
        per_episode: One value per episode instead of one per row.
    """

    name: str
    width: int | None
    kind: Literal["number", "text"] = "number"
    components: tuple[str, ...] = ()
    unit: str = ""
    per_episode: bool = False


@dataclass(frozen=True)
class RawEpisode:
    """One episode as recorded.

    Attributes:
        label: What texts and tables call it.
        digest: SHA-256 of the file that it came from.
        columns: Values by column, (n,) or (n, width); all of one length.
        attributes: Values that hold for the whole episode; `episode_uuid` among them if it has
            one.
        first_row: Rows of the recordings before it, where no clock tells when it began.
        left: What was recorded of it and not read, by name, and why.
    """

    label: str
    digest: str
    columns: dict[str, NDArray[Any]]
    attributes: dict[str, str] = field(default_factory=dict)
    first_row: int = 0
    left: dict[str, str] = field(default_factory=dict)


Also = Callable[[Column], bool]
"""Whether a column is to be read although nothing depends on it."""


def nothing(column: Column) -> bool:
    """No column beside those wanted."""
    return False


class Source(Protocol):
    """Recordings of one layout, opened and described, not yet read."""

    @property
    def name(self) -> str:
        """What texts call the recordings."""
        ...

    @property
    def columns(self) -> tuple[Column, ...]:
        """The columns that could be read."""
        ...

    @property
    def rate_hz(self) -> float | None:
        """Rate that the recordings state."""
        ...

    @property
    def labels(self) -> Labels:
        """Labels that the layout defines, or that a column's name gives away."""
        ...

    @property
    def notes(self) -> tuple[str, ...]:
        """What was found missing, contradictory or skipped, a sentence each."""
        ...

    @property
    def count(self) -> int | None:
        """Number of episodes, where it is known before reading."""
        ...

    @property
    def known(self) -> ImportContract | None:
        """The contract of these very recordings, where their layout is known by heart."""
        ...

    def episodes(
        self, wanted: Sequence[str], episode: str | None = None, also: Also = nothing
    ) -> Iterator[RawEpisode | Refusal]:
        """Each episode with the `wanted` columns, or why it could not be read, in order.

        Args:
            wanted: Columns to read; an episode that lacks one is refused.
            episode: Column of the episodes, for layouts that do not define it.
            also: Says which other columns to read where they are there.
        """
        ...


class Budget:
    """Bytes that may still be read of an episode of what nothing depends on."""

    def __init__(self) -> None:
        """Nothing is taken yet."""
        self._left = MAXIMUM_BESIDE_BYTES

    def takes(self, size: int) -> bool:
        """Whether so many bytes more are few enough; then they are taken."""
        fits = size <= self._left
        self._left -= size if fits else 0
        return fits


def bytes_of(column: Column, rows: int) -> int:
    """Bytes of so many rows of a column, whose texts are taken for short ones."""
    return 8 * rows * (1 if column.width is None else column.width)


def refusal_of(label: str, error: BadInputError) -> Refusal:
    """The refusal that an error means for one episode."""
    return Refusal(file=label, where=error.where, reason=str(error))


def check_columns(
    columns: dict[str, NDArray[Any]], *, label: str, known: dict[str, Column]
) -> None:
    """Every column has the width that the recordings declare, and all have one length.

    Raises:
        ContractError: Names the column.
    """
    length: int | None = None
    for name, values in columns.items():
        if known[name].kind == "number" and values.dtype.kind not in "fiub":
            refuse(f"{label}: {name}", f"of type {values.dtype}", "numbers")
        width = known[name].width
        expected = (len(values),) if width is None else (len(values), width)
        if values.shape != expected:
            refuse(f"{label}: {name}", f"of shape {values.shape}", f"{expected}")
        if length is not None and len(values) != length:
            refuse(f"{label}: {name}", f"{len(values)} rows long", f"{length}, as the others")
        length = len(values)


def as_float(values: NDArray[Any]) -> NDArray[np.float64]:
    """Numbers as float64."""
    return np.asarray(values, dtype=np.float64)


def refuse(where: str, found: str, expected: str, action: str = ACTION) -> NoReturn:
    """Raise the error of a recording that is not what it should be."""
    raise ContractError(where=where, found=found, expected=expected, action=action)
