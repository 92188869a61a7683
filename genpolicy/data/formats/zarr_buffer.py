"""A zarr v2 replay buffer (the layout published with Diffusion Policy) to a dataset.

The buffer knows rows and episode ends and nothing else: no clock, no outcome, no operator, no
epoch. They are declared `not_recorded` and never guessed. zarr fills missing chunks with zeros
and can name codecs that unpickle; both are refused before anything is decoded.
"""

import math
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any, NoReturn

import numpy as np
import zarr
from numpy.typing import NDArray

from genpolicy.data.assemble import Refusal
from genpolicy.data.formats.contract import (
    ActionSource,
    ChannelSource,
    Frozen,
    ImportContract,
    Labels,
)
from genpolicy.data.formats.source import Also, Column, RawEpisode, nothing
from genpolicy.errors import BadInputError, ContractError, IntegrityError
from genpolicy.integrity.documents import canonical_json, read_json
from genpolicy.integrity.hashing import sha256_bytes, sha256_tree

MAXIMUM_ARRAY_BYTES = 1 << 30
NUMERIC_TYPES = ("<f4", "<f8", "<i4", "<i8", "<i2", "<u2", "<u4", "|i1", "|u1", "|b1")
TEXT = "<U"
COMPRESSORS = ("blosc", "zstd", "zlib", "lz4")
ACTION = "Fetch the buffer again, or leave this episode out."
BOARD_PX = [-64.0, 576.0]
PUSHT_ARRAYS = {"state": 5, "action": 2, "n_contacts": 1}

PUSHT = ImportContract(
    format="zarr",
    task="pusht",
    rate_hz=10.0,
    channels=[
        ChannelSource(
            name="agent_position_px", columns=["state[0:2]"], components=["x", "y"], unit="px",
            stream="state", maximum_age_s=0.1,
        ),
        ChannelSource(
            name="block_position_px", columns=["state[2:4]"], components=["x", "y"], unit="px",
            stream="state", maximum_age_s=0.1,
        ),
        ChannelSource(
            name="block_angle", columns=["state[4]"], components=["cos", "sin"], unit="rad",
            stream="state", transform="cos_sin", maximum_age_s=0.1,
        ),
    ],
    action=ActionSource(
        columns=["action[0:2]"], components=["agent_x_px", "agent_y_px"], units=["px", "px"],
        frame="board",
    ),
    pairing={"agent_x_px": "agent_position_px.x", "agent_y_px": "agent_position_px.y"},
    ranges={
        "agent_position_px.x": BOARD_PX,
        "agent_position_px.y": BOARD_PX,
        "block_position_px.x": BOARD_PX,
        "block_position_px.y": BOARD_PX,
        "action.agent_x_px": BOARD_PX,
        "action.agent_y_px": BOARD_PX,
    },
    frozen=Frozen(streams=["state"], seconds=2.0, motion=64.0),
)  # fmt: skip


class ReplayBuffer:
    """The arrays of a buffer as a source; see `genpolicy.data.formats.source.Source`."""

    rate_hz: float | None = None
    labels = Labels()

    def __init__(self, path: Path) -> None:
        """Describe the arrays; decodes nothing but the episode ends.

        Raises:
            BadInputError: Not such a buffer, or an array that is not plain numbers.
        """
        self.path = path
        self.name = path.name
        ends = path / "meta" / "episode_ends"
        _check_head(_head(ends), str(ends))
        columns: list[Column] = []
        skipped: list[str] = []
        for folder in sorted((path / "data").glob("*/.zarray")):
            column = _column(folder.parent)
            if column is None:
                skipped.append(folder.parent.name)
            else:
                columns.append(column)
        self._described = [
            folder.parent.name
            for folder in sorted((path / "meta").glob("*/.zarray"))
            if folder.parent != ends and _is_single(folder.parent)
        ]
        # Described before it is hashed, hashed before it is decoded.
        self.digest = sha256_bytes(canonical_json(sha256_tree(path)))
        self._ends = _array(ends)
        steps = np.diff(self._ends, prepend=0)
        if self._ends.ndim != 1 or not (steps > 0).all():
            _refuse(f"{path}/meta/episode_ends", "not rising", "the last row of each episode")
        self.columns = tuple(columns)
        self.notes = (f"Not read: {', '.join(skipped)} (no plain columns).",) if skipped else ()
        self.count = len(self._ends)

    @property
    def known(self) -> ImportContract | None:
        """PushT, recognised by its arrays."""
        widths = {column.name: column.width for column in self.columns}
        return PUSHT if PUSHT_ARRAYS.items() <= widths.items() else None

    def episodes(
        self, wanted: Sequence[str], episode: str | None = None, also: Also = nothing
    ) -> Iterator[RawEpisode | Refusal]:
        """Each episode with the wanted arrays, and others of one value a row or an episode.

        Raises:
            BadInputError: An array is missing, incomplete, or of another length than the ends.
        """
        rows = int(self._ends[-1])
        arrays = {name: _array(self.path / "data" / name) for name in wanted}
        for name, values in arrays.items():
            if len(values) != rows:
                place = f"{self.path}/meta/episode_ends"
                _refuse(place, f"{rows} at its end", f"{len(values)}, the rows of {name}")
        single = self._single(wanted, also)
        arrays |= {name: values for name, values in single.items() if len(values) == rows}
        by_episode = {n: v for n, v in single.items() if len(v) == len(self._ends) != rows}
        for number, end in enumerate(self._ends.tolist()):
            start = int(self._ends[number - 1]) if number else 0
            yield RawEpisode(
                label=f"{self.name}#episode_{number:06d}",
                digest=self.digest,
                columns={name: values[start:end] for name, values in arrays.items()},
                attributes={name: str(values[number]) for name, values in by_episode.items()},
                first_row=start,
            )

    def _single(self, wanted: Sequence[str], also: Also) -> dict[str, NDArray[Any]]:
        """Arrays of one axis beside those wanted, of the rows or of the episodes."""
        places = {c.name: self.path / "data" / c.name for c in self.columns if c.width is None}
        places |= {name: self.path / "meta" / name for name in self._described}
        return {
            name: _array(place)
            for name, place in sorted(places.items())
            if name not in wanted and also(Column(name, None))
        }


def open_source(path: Path) -> ReplayBuffer:
    """A replay buffer, described; see `ReplayBuffer`."""
    return ReplayBuffer(path)


def _column(folder: Path) -> Column | None:
    """An array as a column; None for pictures and other arrays of more than two axes."""
    head = _head(folder)
    if not (isinstance(head["shape"], list) and len(head["shape"]) <= 2):
        return None
    _check_head(head, str(folder))
    width = int(head["shape"][1]) if len(head["shape"]) == 2 else None
    if str(head["dtype"]).startswith(TEXT):
        return Column(folder.name, width, "text")
    return Column(folder.name, width)


def _is_single(folder: Path) -> bool:
    column = _column(folder)
    return column is not None and column.width is None


def _head(folder: Path) -> dict[str, Any]:
    head = read_json(folder / ".zarray")
    keys = ("dtype", "shape", "compressor", "filters", "zarr_format")
    if not isinstance(head, dict) or any(key not in head for key in keys):
        _refuse(f"{folder}/.zarray", "not an array description", f"the keys {keys}")
    return head


def _check_head(head: dict[str, Any], place: str) -> None:
    """Plain numbers of a bounded size, in a codec that runs no foreign code."""
    try:
        kind, shape, compressor = head["dtype"], list(head["shape"]), head["compressor"]
        size = math.prod(int(n) for n in shape) * int(str(kind)[2:])
        text = str(kind).startswith(TEXT) and len(shape) == 1
        codec = None if compressor is None else compressor["id"]
        known = kind in NUMERIC_TYPES or text
        plain = known and not head["filters"] and head["zarr_format"] == 2
    except (KeyError, TypeError, ValueError) as error:
        raise ContractError(
            where=f"{place}/.zarray",
            found=f"not an array description ({error!r:.80})",
            expected="zarr version 2",
            action=ACTION,
        ) from error
    if not plain or codec not in (None, *COMPRESSORS):
        _refuse(f"{place}/.zarray", f"of type {kind!r:.20}, codec {codec!r:.20}", "plain numbers")
    if not (0 < size <= MAXIMUM_ARRAY_BYTES and all(int(n) > 0 for n in shape)):
        _refuse(place, f"{size} bytes", f"1 to {MAXIMUM_ARRAY_BYTES}")


def _array(folder: Path) -> NDArray[Any]:
    """A whole numeric zarr v2 array, its description checked before it is decoded."""
    place = str(folder)
    _check_head(_head(folder), place)
    try:
        array = zarr.open_array(str(folder), mode="r", zarr_format=2)
        if array.nchunks_initialized != array.nchunks:
            _refuse(place, f"{array.nchunks_initialized} chunks", f"all {array.nchunks} of them")
        return np.asarray(array[:])
    except BadInputError:
        raise
    except Exception as error:  # decoders raise whatever they like on changed bytes
        raise IntegrityError(
            where=place,
            found=f"not decodable ({' '.join(str(error).split())[:120]})",
            expected="whole chunks",
            action=ACTION,
        ) from error


def _refuse(where: str, found: str, expected: str) -> NoReturn:
    raise ContractError(where=where, found=found, expected=expected, action=ACTION)
