"""LeRobot v2.1 and v3.0: what is read, what is noted, what is refused by name."""

import json
from pathlib import Path

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
import pytest

from genpolicy.data.dataset import load_dataset
from genpolicy.data.formats import open_dataset, propose
from genpolicy.data.formats.open_questions import open_questions
from genpolicy.errors import BadInputError

REAL = Path(__file__).parents[4] / "shared/data/g1_bottle_lerobot_v21"


@pytest.mark.parametrize("version", ["v2", "v3"])
@pytest.mark.parametrize("kind", ["fixed", "list", "text"])
def test_damage_beside_the_contract_refuses_nothing(layouts, tmp_path, version, kind):
    root = getattr(layouts, version)(tmp_path / "recordings")
    path = sorted(root.glob("data/*/*.parquet"))[0]
    for file in sorted(root.glob("data/*/*.parquet")):
        rows = pq.read_table(file)
        values = {
            "fixed": layouts.vectors(np.ones((len(rows), 2))),
            "list": pa.array([[1.0, 2.0]] * len(rows)),
            "text": pa.array(["kitchen"] * len(rows)),
        }
        pq.write_table(rows.append_column("emb", values[kind]), file, row_group_size=30)
    whole = bytearray(path.read_bytes())
    metadata = pq.ParquetFile(path).metadata
    part = metadata.row_group(0).column(metadata.num_columns - 1)
    place = part.dictionary_page_offset or part.data_page_offset
    whole[place : place + 30] = bytes(30)
    path.write_bytes(whole)
    opened = open_dataset(root, out=tmp_path / "out")
    assert (opened.found, opened.accepted) == (6, 6)
    assert "Not looked at as a reason, not readable: emb." in opened.notes


@pytest.mark.parametrize("version", ["v2", "v3"])
def test_both_versions_give_the_same_dataset(layouts, tmp_path, version):
    root = getattr(layouts, version)(tmp_path / "recordings")
    opened = open_dataset(root, out=tmp_path / "out")
    assert (opened.found, opened.accepted, len(opened.refused)) == (6, 6, 0)
    dataset = load_dataset(tmp_path / "out")
    state, action = layouts.samples(2)
    begins = dataset.frames.observation[dataset.frames.index == 0]
    rows = dataset.frames.episode == np.argmin(np.abs(begins - state[0]).max(axis=1))
    np.testing.assert_allclose(dataset.frames.observation[rows], state.astype("f4"))
    np.testing.assert_allclose(dataset.frames.action[rows], action.astype("f4"))
    np.testing.assert_allclose(np.diff(dataset.frames.event_time_s[rows]), 0.05, atol=1e-5)
    assert set(dataset.episodes["task"]) == {"push the block"}
    assert dataset.manifest["import_contract"]["pairing"] == {
        "shoulder_pan": "state_rad.shoulder_pan",
        "elbow_flex": "state_rad.elbow_flex",
        "gripper": "state.gripper",
    }
    operators = set(dataset.episodes["operator"])
    assert operators == ({"op0", "op1"} if version == "v3" else {"not_recorded"})
    notes = " ".join(opened.notes)
    assert "Units were guessed: state_rad (rad), state (1), action (rad, 1)." in notes
    assert "observation.images.top" in notes
    assert ("operator" in notes.split("Not recorded:")[1]) == (version == "v2")


def test_same_recordings_give_the_same_bytes(layouts, tmp_path):
    root = layouts.v3(tmp_path / "recordings")
    bytes_of = []
    for name in ("a", "b"):
        open_dataset(root, out=tmp_path / name)
        bytes_of.append({p.name: p.read_bytes() for p in (tmp_path / name).iterdir()})
    assert bytes_of[0] == bytes_of[1]


def bad_frames(layouts):
    index = np.arange(30)
    index[7:] += 1
    return {"frame_index": pa.array(index)}


def with_nan(layouts):
    _, action = layouts.samples(3)
    action[11, 1] = np.nan
    return {"action": layouts.vectors(action)}


FAULTS = {
    "frame_index, row 7": bad_frames,
    "row 11, column action[1] is nan": with_nan,
    "episode_index, row 0": lambda _: {"episode_index": pa.array(np.full(30, 4))},
    "index, row 9": lambda _: {
        "index": pa.array(np.where(np.arange(30) < 9, 0, 5) + np.arange(30))
    },
    "timestamp, row 4": lambda _: {
        "timestamp": pa.array(np.where(np.arange(30) == 4, 0.0, np.arange(30) / 20).astype("f4"))
    },
    "a gap of": lambda _: {
        "timestamp": pa.array((np.arange(30) / 20 + 2.0 * (np.arange(30) > 5)).astype("f4"))
    },
    "of shape (30, 2)": lambda la: {"action": la.vectors(la.samples(3)[1][:, :2])},
    "of type": lambda _: {"action": pa.array(["left"] * 30)},
    "again, expected every episode once": lambda la: {
        "observation.state": la.vectors(la.samples(1)[0]),
        "action": la.vectors(la.samples(1)[1]),
    },
    "task_index, row 20": lambda _: {"task_index": pa.array((np.arange(30) >= 20).astype("i8"))},
    "3 rows long": None,
    "not a readable table": b"PAR1 and nothing more",
}


@pytest.mark.parametrize("reason", list(FAULTS))
def test_a_bad_episode_is_refused_by_name_with_row_and_reason(layouts, tmp_path, reason):
    root = layouts.v2(tmp_path / "recordings")
    make = FAULTS[reason]
    path = layouts.file(root, 3)
    if isinstance(make, bytes):
        path.write_bytes(make)
    elif make is None:
        layouts.write(path, layouts.table(3, rows=3))
    else:
        layouts.write(path, layouts.table(3, first=90, **make(layouts)))
    opened = open_dataset(root, out=tmp_path / "out")
    assert (opened.found, opened.accepted) == (6, 5)
    (refusal,) = opened.refused
    assert refusal.file == "data/chunk-000/episode_000003.parquet"
    assert reason in refusal.reason


def test_a_truncated_file_is_refused(layouts, tmp_path):
    root = layouts.v2(tmp_path / "recordings")
    whole = layouts.file(root, 2).read_bytes()
    for share in (0.2, 0.7, 0.99):
        layouts.file(root, 2).write_bytes(whole[: int(len(whole) * share)])
        opened = open_dataset(root, out=tmp_path / "out")
        assert [r.file for r in opened.refused] == ["data/chunk-000/episode_000002.parquet"]


def test_counts_that_disagree_are_notes_and_the_data_decide(layouts, tmp_path):
    root = layouts.v2(tmp_path / "recordings", total_episodes=50, total_frames=7)
    opened = open_dataset(root, out=tmp_path / "out")
    assert opened.accepted == 6
    assert any("counts 50 episodes, the list has 6" in note for note in opened.notes)
    assert any("counts 50 episodes, there are 6 files" in note for note in opened.notes)
    assert any("counts 7 frames" in note for note in opened.notes)
    assert load_dataset(tmp_path / "out").manifest["notes"] == list(opened.notes)


def test_listed_without_data_is_found_and_refused(layouts, tmp_path):
    root = layouts.v2(tmp_path / "recordings")
    layouts.file(root, 5).unlink()
    opened = open_dataset(root, out=tmp_path / "out")
    assert (opened.found, opened.accepted) == (6, 5)
    assert "listed in the metadata and has no data" in opened.refused[0].reason


def test_v3_episode_in_two_files_is_refused_once(layouts, tmp_path):
    root = layouts.v3(tmp_path / "recordings", count=8, per_file=4)
    table = pa.concat_tables([layouts.table(i, first=30 * i) for i in (1, 5, 6, 7)])
    layouts.write(root / "data/chunk-000/file-001.parquet", table)
    opened = open_dataset(root, out=tmp_path / "out")
    reasons = [refusal.reason for refusal in opened.refused]
    assert any("file-001.parquet#episode_000001: episode_index" in reason for reason in reasons)
    assert any("episode_000004 is listed" in reason for reason in reasons)
    assert (opened.found, opened.accepted) == (9, 7)


def test_a_link_out_of_the_dataset_is_refused(layouts, tmp_path):
    root = layouts.v2(tmp_path / "recordings")
    outside = tmp_path / "outside.parquet"
    layouts.file(root, 0).rename(outside)
    layouts.file(root, 0).symlink_to(outside)
    with pytest.raises(BadInputError, match="leads out of the dataset"):
        open_dataset(root, out=tmp_path / "out")


def test_a_link_inside_the_dataset_is_not_followed(layouts, tmp_path):
    root = layouts.v2(tmp_path / "recordings")
    layouts.file(root, 4).rename(root / "elsewhere.parquet")
    layouts.file(root, 4).symlink_to(root / "elsewhere.parquet")
    opened = open_dataset(root, out=tmp_path / "out")
    assert [r.file for r in opened.refused] == ["data/chunk-000/episode_000004.parquet"]
    assert "expected a regular file, not a link" in opened.refused[0].reason


def test_leader_and_follower_of_different_build(layouts, tmp_path):
    """Four joints of a leader, three of a follower: what follows pairs, no more."""
    root = layouts.v2(tmp_path / "recordings")
    leader = ["base", "shoulder_pan", "wrist_a", "wrist_b"]
    layouts.write(
        root / "meta/info.json",
        layouts.info(
            features={
                "observation.state": layouts.feature(["shoulder_pan", "elbow_flex", "gripper"]),
                "action": layouts.feature(leader, size=4),
            }
        ),
    )
    for i in range(6):
        others = np.random.default_rng(i + 50).normal(0.0, 0.1, (30, 3)).cumsum(axis=0)
        action = np.concatenate([others, layouts.samples(i)[1][:, :1]], axis=1)
        action = action[:, [1, 3, 0, 2]]
        table = layouts.table(i, first=30 * i, action=layouts.vectors(action))
        layouts.write(layouts.file(root, i), table)
    contract = propose(root)
    assert contract.pairing == {"shoulder_pan": "state_rad.shoulder_pan"}
    assert any("base, wrist_a, wrist_b say where" in note for note in open_questions(contract))
    features = json.loads((root / "meta/info.json").read_text())["features"]
    features["action"]["names"] = ["base", "torso", "wrist_a", "wrist_b"]
    layouts.write(root / "meta/info.json", layouts.info(features=features))
    opened = open_dataset(root, out=tmp_path / "out")
    assert opened.accepted == 6


def test_a_difference_under_the_same_name_is_a_change(layouts, tmp_path):
    root = layouts.v2(tmp_path / "recordings")
    for i in range(6):
        state = layouts.samples(i)[0]
        change = layouts.vectors(np.diff(state, axis=0, append=state[-1:]))
        layouts.write(layouts.file(root, i), layouts.table(i, first=30 * i, action=change))
    contract = propose(root)
    assert list(contract.pairing or {}) == ["shoulder_pan", "elbow_flex", "gripper"]
    assert {form.form for form in contract.forms.values()} == {"change"}
    assert not contract.pairing_guessed and contract.forms_guessed
    assert any("a change per row (gain 1): shoulder_pan" in n for n in open_questions(contract))


@pytest.mark.skipif(not REAL.is_dir(), reason="the G1 recordings are not on this machine")
def test_g1(tmp_path):
    """Golden: 100 episodes, 35,965 rows at 30 Hz, 26 joints, nothing labelled (data/README)."""
    opened = open_dataset(REAL, out=tmp_path / "out")
    dataset = load_dataset(tmp_path / "out")
    assert (opened.found, opened.accepted, len(dataset.frames)) == (100, 100, 35_965)
    assert opened.contract.rate_hz == 30.0
    assert len(opened.contract.pairing or {}) == 26
    units = dict.fromkeys(opened.contract.action.units)
    assert list(units) == ["rad", "1"]  # the hands are recorded from 0 to 1, not in radians
    missing = "Not recorded: phase, object, operator, calibration_epoch, outcome, is_recovery."
    assert missing in opened.notes
    assert set(dataset.episodes["operator"]) == {"not_recorded"}
