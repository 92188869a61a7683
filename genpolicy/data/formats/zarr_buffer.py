"""A zarr replay buffer (the layout published with Diffusion Policy) to a dataset.

Arrays hold all episodes one after the other, and one array says where each ends, or how long it is.
The buffer knows rows and episode ends: clock, outcome, operator and epoch are `not_recorded` unless
an array has such a name, and never guessed.
"""

from collections.abc import Iterator, Sequence
from pathlib import Path

import numpy as np

from genpolicy.data.assemble import Refusal
from genpolicy.data.formats.columns import labels_of
from genpolicy.data.formats.contract import (
    ActionSource,
    ChannelSource,
    Frozen,
    ImportContract,
)
from genpolicy.data.formats.sidecars import of_zarr
from genpolicy.data.formats.source import Also, RawEpisode, nothing
from genpolicy.data.formats.zarr_arrays import (
    arrays_below,
    check_head,
    column_of,
    head_of,
    read_array,
    refuse,
)
from genpolicy.data.formats.zarr_beside import Beside, described, lists_of
from genpolicy.data.formats.zarr_groups import EpisodeGroups, groups_of
from genpolicy.integrity.documents import canonical_json
from genpolicy.integrity.hashing import sha256_bytes, sha256_tree

# Arrays that say where episodes end, or how long each is, by the names that people give them.
ENDS = ("episode_ends", "episode_end", "traj_ends", "trajectory_ends")
LENGTHS = ("episode_lengths", "episode_length", "traj_lengths", "traj_length", "seq_lengths")
PLACES = ("meta", "", "data", "info")
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

    def __init__(self, path: Path) -> None:
        """Describe the arrays; decodes nothing but the episode ends.

        Raises:
            BadInputError: Not such a buffer, or an array that is not plain numbers.
        """
        self.path = path
        self.name = path.name
        found = ends_of(path)
        if found is None:
            refuse(
                str(path),
                "a Zarr group without meta/episode_ends or another array of where episodes end",
                "a replay buffer, or a group per episode",
                "Give the folder that holds data and meta.",
            )
        ends, lengths = found
        check_head(head_of(ends), str(ends))
        inside = arrays_below(path / "data" if (path / "data").is_dir() else path)
        self._places = {name: folder for name, folder in inside.items() if folder != ends}
        fields = {name: column_of(name, folder) for name, folder in self._places.items()}
        columns = [column for column in fields.values() if column is not None]
        beside = arrays_below(path / "meta") if (path / "meta").is_dir() else {}
        others = {
            name if name not in self._places else f"meta/{name}": folder
            for name, folder in beside.items()
            if folder not in (ends, *self._places.values())
        }
        # Described before it is hashed, hashed before it is decoded.
        self.digest = sha256_bytes(canonical_json(sha256_tree(path)))
        values = read_array(ends)
        self._ends = np.cumsum(values, axis=0) if lengths else values
        steps = np.diff(self._ends, prepend=0)
        if self._ends.ndim != 1 or not (steps > 0).all():
            refuse(str(ends), "not rising", "the last row of each episode")
        rows = int(self._ends[-1])
        fitting = [c for c in columns if _rows_of(self._places[c.name]) == rows]
        self.columns = tuple(fitting or columns)  # where none fits, that is the error
        self._beside = described(self._places | others, rows=rows, episodes=len(self._ends))
        self._listed = lists_of(path, len(self._ends))
        self.labels = labels_of(self.columns, episode=None, frame=None)
        self.notes = (*self._beside.notes(), *of_zarr(path))
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
        arrays = {name: read_array(self._place(name)) for name in wanted}
        for name, values in arrays.items():
            if len(values) != rows:
                place = f"{self.path}/meta/episode_ends"
                refuse(place, f"{rows} at its end", f"{len(values)}, the rows of {name}")
        ends = self._ends.tolist()
        beside = Beside(self._beside, ends, read=wanted, also=also)
        for number, end in enumerate(ends):
            start = ends[number - 1] if number else 0
            columns = {name: values[start:end] for name, values in arrays.items()}
            listed = {name: texts[number] for name, texts in self._listed.items()}
            yield RawEpisode(
                label=f"{self.name}#episode_{number:06d}",
                digest=self.digest,
                columns=columns | beside.next(),
                attributes=listed | beside.of_episode(number),
                first_row=start,
                left=dict(beside.left),
            )

    def _place(self, name: str) -> Path:
        return self._places.get(name, self.path / "data" / name)


def ends_of(path: Path) -> tuple[Path, bool] | None:
    """The array of where episodes end, and whether it gives lengths; None where there is none."""
    for names, lengths in ((ENDS, False), (LENGTHS, True)):
        for place in PLACES:
            for name in names:
                folder = path / place / name
                if (folder / ".zarray").is_file() or (folder / "zarr.json").is_file():
                    return folder, lengths
    return None


def open_source(path: Path) -> ReplayBuffer | EpisodeGroups:
    """A replay buffer, or a group per episode, described.

    Raises:
        BadInputError: Neither.
    """
    groups = None if ends_of(path) else groups_of(path)
    return ReplayBuffer(path) if groups is None else EpisodeGroups(path, groups)


def _rows_of(folder: Path) -> int:
    return int(head_of(folder)["shape"][0])
