"""Bad recordings through the stage: each refused by name, the rest accepted, nothing vanishes."""

import json
import shutil
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from genpolicy.data.recording.episode import RecordedEpisode
from genpolicy.data.recording.reader import read_episode
from genpolicy.data.recording.writer import write_episode


@pytest.fixture
def recordings(recorded, tmp_path, monkeypatch) -> list[Path]:
    """A workspace of its own with those recordings, which is the current folder."""
    shutil.copytree(recorded, tmp_path / "run")
    monkeypatch.chdir(tmp_path / "run")
    return sorted((tmp_path / "run" / "artifacts" / "record" / "episodes").glob("*.mcap"))


def rewrite(path: Path, change: Callable[[RecordedEpisode], RecordedEpisode]) -> None:
    write_episode(path, change(read_episode(path)))


def with_values(stream: str, change: Callable[[np.ndarray], np.ndarray]):
    def changed(episode: RecordedEpisode) -> RecordedEpisode:
        samples = episode.streams[stream]
        values = change(np.array(samples.values))
        return replace(
            episode, streams={**episode.streams, stream: replace(samples, values=values)}
        )

    return changed


def in_millimetres(values: np.ndarray) -> np.ndarray:
    values[:, :3] *= 1000.0
    return values


def with_a_hole(values: np.ndarray) -> np.ndarray:
    values[7, 1] = np.nan
    return values


def without(stream: str):
    return lambda episode: replace(
        episode, streams={k: v for k, v in episode.streams.items() if k != stream}
    )


def damage(paths: list[Path]) -> dict[str, str]:
    """Spoil the first eight recordings, each in its own way; name -> what the reason must say."""
    paths[0].write_bytes(paths[0].read_bytes()[: paths[0].stat().st_size * 2 // 3])
    rewrite(paths[1], with_values("robot", lambda v: np.tile(v[:1], (len(v), 1))))
    rewrite(paths[2], without("action"))
    rewrite(paths[3], with_values("force", with_a_hole))
    rewrite(paths[4], with_values("robot", in_millimetres))
    shutil.copy(paths[8], paths[5])
    paths[6].write_bytes(b"")
    data = bytearray(paths[7].read_bytes())
    data[len(data) // 2] ^= 1
    paths[7].write_bytes(bytes(data))
    return {
        paths[0].name: "", paths[1].name: "constant", paths[2].name: "action",
        paths[3].name: "row 7", paths[4].name: "tcp_position_m.x",
        paths[8].name: f"shares its episode_uuid with {paths[5].name}",
        paths[6].name: "", paths[7].name: "",
    }  # fmt: skip


def test_each_bad_recording_is_refused_by_name_and_none_vanishes(recordings, stage) -> None:
    expected = damage(recordings)
    code, said = stage("ingest")
    assert code == 0, said
    document = json.loads(Path("artifacts/ingest/refusals.json").read_text())
    assert document["found"] == len(recordings)
    assert document["accepted"] + len(document["refused"]) == document["found"]
    refused = {entry["file"]: entry for entry in document["refused"]}
    assert set(refused) == set(expected)
    for name, words in expected.items():
        entry = refused[name]
        assert entry["where"].startswith(name)
        assert words in entry["reason"], entry
        assert "\n" not in entry["reason"]
    import pyarrow.parquet as pq

    episodes = pq.read_table("artifacts/ingest/episodes.parquet").to_pylist()
    assert {row["source_file"] for row in episodes} == {p.name for p in recordings} - set(expected)


def test_only_bad_recordings_are_bad_input(recordings, stage) -> None:
    for path in recordings:
        path.write_bytes(path.read_bytes()[:1000])
    code, said = stage("ingest")
    assert (code, said.count("\n")) == (2, 1), said
    assert said.startswith("ingest: ")
    assert recordings[0].name in said, "the first refusal says what to look at"
    assert sorted(p.name for p in Path("artifacts").iterdir()) == ["record", "task"]


def test_recordings_of_another_task_are_refused(recordings, stage) -> None:
    """Streams and units may be the same: the metadata say what was done."""

    def of_a_drawer(episode: RecordedEpisode) -> RecordedEpisode:
        return replace(episode, metadata={**episode.metadata, "task": "drawer_opening"})

    for path in recordings:
        rewrite(path, of_a_drawer)
    code, said = stage("ingest")
    assert (code, said.count("\n")) == (2, 1), said
    assert "metadata task" in said and "drawer_opening" in said and "tabletop_insertion" in said
    assert sorted(p.name for p in Path("artifacts").iterdir()) == ["record", "task"]


def test_no_recording_is_bad_input(recordings, stage) -> None:
    for path in recordings:
        path.unlink()
    code, said = stage("ingest")
    assert (code, said.count("\n")) == (2, 1), said
    assert sorted(p.name for p in Path("artifacts").iterdir()) == ["record", "task"]


def test_refusals_do_not_depend_on_the_order_of_names(recordings, stage) -> None:
    """The same refused recordings give the same dataset, byte by byte, when ingested again."""
    damage(recordings)
    assert stage("ingest")[0] == 0
    first = {p.name: p.read_bytes() for p in Path("artifacts/ingest").iterdir()}
    assert stage("ingest")[0] == 0
    assert {p.name: p.read_bytes() for p in Path("artifacts/ingest").iterdir()} == first
