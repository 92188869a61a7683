"""How a wrong gets into a workspace: patches of its code, edits of recordings and artifacts.

Everything here writes below the workspace only. `dvc commit` makes DVC take edited artifacts for
what their stage wrote, as somebody would who wants to pass; without it DVC would make them again.
"""

import json
import os
import shutil
import subprocess
import sys
from collections.abc import Callable
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import pyarrow as pa
from safetensors.numpy import load_file, save_file

from benchmarks.ladder_truth.outcome import Expected
from benchmarks.ladder_truth.workspace import BROUGHT
from flows.reproduce import stage_environment
from genpolicy.data.recording.episode import RecordedEpisode, StreamSamples
from genpolicy.data.recording.reader import read_episode
from genpolicy.data.recording.writer import write_episode
from genpolicy.integrity.documents import canonical_json
from genpolicy.integrity.hashing import sha256_file
from genpolicy.integrity.tables import read_table, write_table

Plant = Callable[[Path], Any]
Change = Callable[[RecordedEpisode], RecordedEpisode | None]


@dataclass(frozen=True)
class Wrong:
    """One planted wrong.

    Attributes:
        name: Its name, unique.
        area: What kind of thing is wrong.
        wrong: What is wrong, in one sentence.
        base: Honest ladder that it is planted in.
        plant: Puts it there.
        expected: Gate and reason, named before anything was run.
        note: What changed about the expectation afterwards, and why; empty as first written.
        together: Wrongs of one such name are planted into one copy and run once: each is one
            candidate more, and is counted by what stops that one. Empty where it runs alone.
    """

    name: str
    area: str
    wrong: str
    base: str
    plant: Plant
    expected: Expected
    note: str = ""
    together: str = ""

    @property
    def candidate(self) -> str:
        """The candidate that it is, where it runs together with others."""
        return self.expected.candidate


@dataclass(frozen=True)
class Several:
    """Several edits, in this order."""

    plants: tuple[Plant, ...]

    def __call__(self, workspace: Path) -> None:
        """Make them."""
        for part in self.plants:
            part(workspace)


@dataclass(frozen=True)
class Patch:
    """Replaces text that must be there exactly once in a file of the workspace's own code."""

    file: str
    changes: tuple[tuple[str, str], ...]

    def text(self, root: Path) -> str:
        """The file below `root`, patched; an assertion fails where a text is not there once."""
        text = (root / self.file).read_text()
        for old, new in self.changes:
            assert text.count(old) == 1, f"{self.file}: {old!r} is there {text.count(old)} times"
            text = text.replace(old, new)
        return text

    def __call__(self, workspace: Path) -> None:
        """Patch it."""
        (workspace / self.file).write_text(self.text(workspace))


def all_of(*plants: Plant) -> Plant:
    """Several edits, in this order."""
    return Several(plants)


def patched(file: str, *changes: tuple[str, str]) -> Plant:
    """Replace text that must be there exactly once in a file of the workspace's own code."""
    return Patch(file, changes)


def patches_of(plant: Plant) -> list[Patch]:
    """The patches of code in a plant."""
    if isinstance(plant, Several):
        return [patch for part in plant.plants for patch in patches_of(part)]
    return [plant] if isinstance(plant, Patch) else []


def document(file: str, change: Callable[[Any], Any]) -> Plant:
    """Edit a JSON document in the product's own serialisation."""

    def plant(workspace: Path) -> None:
        path = workspace / file
        value = json.loads(path.read_bytes())
        changed = change(value)
        path.write_bytes(canonical_json(value if changed is None else changed))

    return plant


def table(file: str, change: Callable[[pd.DataFrame], pd.DataFrame]) -> Plant:
    """Edit a Parquet table; its schema stays."""

    def plant(workspace: Path) -> None:
        before = read_table(workspace / file)
        frame = change(before.to_pandas())
        after = pa.Table.from_pandas(frame, schema=before.schema, preserve_index=False)
        write_table(workspace / file, after)

    return plant


def silently(pattern: str) -> Plant:
    """Flip one bit of the first file that matches; size and times stay, so DVC does not look.

    DVC is shown the copy before: files that are new to it are hashed, and put right.
    """

    def plant(workspace: Path) -> None:
        _dvc(workspace, "status", "--quiet")
        path = sorted(workspace.glob(pattern))[0]
        times = path.stat()
        data = bytearray(path.read_bytes())
        data[len(data) // 2] ^= 1
        with path.open("r+b") as stream:
            stream.write(data)
        os.utime(path, ns=(times.st_atime_ns, times.st_mtime_ns))

    return plant


def committed(*stages: str) -> Plant:
    """Make DVC take what lies in a stage's folder for what the stage wrote."""

    def plant(workspace: Path) -> None:
        _dvc(workspace, "commit", "--force", *stages)

    return plant


def _dvc(workspace: Path, *words: str) -> None:
    """A command of DVC; `status` leaves with 1 where something is to be done."""
    command = [sys.executable, "-m", "dvc", *words]
    done = subprocess.run(
        command, cwd=workspace, env=stage_environment(workspace), check=False, capture_output=True
    )
    if done.returncode and words[0] != "status":
        raise RuntimeError(f"dvc {words[0]}: {done.stderr.decode()[-400:]}")


def recordings(change: Change, *, only: Callable[[int], bool] = lambda number: True) -> Plant:
    """Change the recordings of one's own, in the order of their names; None removes one."""

    def plant(workspace: Path) -> None:
        for number, path in enumerate(sorted((workspace / BROUGHT).glob("*.mcap"))):
            if not only(number):
                continue
            changed = change(read_episode(path))
            if changed is None:
                path.unlink()
            else:
                write_episode(path, changed)

    return plant


def with_stream(
    episode: RecordedEpisode, name: str, change: Callable[[StreamSamples], StreamSamples]
) -> RecordedEpisode:
    """The episode with one stream changed."""
    return replace(episode, streams={**episode.streams, name: change(episode.streams[name])})


def with_values(
    episode: RecordedEpisode, name: str, change: Callable[[np.ndarray], np.ndarray]
) -> RecordedEpisode:
    """The episode with the numbers of one stream changed."""
    return with_stream(episode, name, lambda s: replace(s, values=change(np.array(s.values))))


def with_metadata(episode: RecordedEpisode, **changes: str) -> RecordedEpisode:
    """The episode with other metadata."""
    return replace(episode, metadata={**episode.metadata, **changes})


def side_of(episode: RecordedEpisode) -> str:
    """On which side of the obstacle the hand went: left or right."""
    position = episode.streams["robot"].values[:, :3]
    obstacle = episode.streams["camera"].values[0, 4]
    near = np.abs(position[:, 0] - 0.5) < 0.05
    passing = position[near if near.any() else slice(None), 1]
    return "left" if np.median(passing) > obstacle else "right"


def weights(checkpoint: str, change: Callable[[dict[str, np.ndarray]], Any]) -> Plant:
    """Change a checkpoint's weights, and the hash by which its configuration names them."""

    def plant(workspace: Path) -> None:
        folder = workspace / checkpoint
        path = folder / "model.safetensors"
        tensors = {name: np.array(values) for name, values in load_file(path).items()}
        metadata = _metadata_of(path)
        change(tensors)
        save_file(tensors, path, metadata=metadata)
        document(f"{checkpoint}/config.json", lambda c: c.update(weights_sha256=sha256_file(path)))(
            workspace
        )

    return plant


def copied(source: str, target: str) -> Plant:
    """One file or folder in place of another."""

    def plant(workspace: Path) -> None:
        if (workspace / source).is_dir():
            shutil.copytree(workspace / source, workspace / target, dirs_exist_ok=True)
        else:
            shutil.copyfile(workspace / source, workspace / target)

    return plant


def _metadata_of(path: Path) -> dict[str, str]:
    data = path.read_bytes()
    length = int.from_bytes(data[:8], "little")
    found: dict[str, str] = json.loads(data[8 : 8 + length]).get("__metadata__", {})
    return found
