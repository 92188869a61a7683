"""MCAP recordings: the contract of the task that was recorded, or one of the recorded streams."""

from dataclasses import replace

import numpy as np
import pytest

from genpolicy.data.contract import TCP_ACTION
from genpolicy.data.dataset import load_dataset
from genpolicy.data.formats import open_dataset, propose
from genpolicy.data.formats.contract import contract_of
from genpolicy.errors import BadInputError
from genpolicy.tasks.api import EpisodeSpec, load_task


@pytest.fixture
def recordings(factory, tmp_path):
    """Seven episodes of a task that nobody registered."""
    folder = tmp_path / "recordings"
    folder.mkdir()
    factory.write_all(folder, [factory.episode(i, steps=14) for i in range(7)])
    return folder


def test_the_recorded_streams_make_a_contract(recordings, factory, tmp_path):
    opened = open_dataset(recordings, out=tmp_path / "out")
    assert (opened.found, opened.accepted) == (7, 7)
    contract = opened.contract
    assert contract.task == "reach"
    assert contract.rate_hz == 20.0
    assert contract.action_contract == TCP_ACTION
    assert [c.name for c in contract.channels] == [
        "target_pose", "obstacle_position_m", "wrench_n",
        "tcp_position_m", "tcp_rotation", "gripper_opening_m",
    ]  # fmt: skip
    assert contract.pairing is not None
    assert contract.pairing["tcp_x_m"] == "tcp_position_m.x"
    assert contract.phases == list(factory.PHASES)
    dataset = load_dataset(tmp_path / "out")
    assert set(dataset.episodes["operator"]) == {"op0", "op1"}
    assert dataset.manifest["import_contract"] == contract.model_dump(mode="json")


def test_a_stub_of_three_messages_filed_under_success_is_refused(recordings, factory, tmp_path):
    (recordings / "success").mkdir()
    stub = factory.episode(50, steps=3, outcome="success")
    factory.write_all(recordings / "success", [stub])
    opened = open_dataset(recordings, out=tmp_path / "out")
    assert (opened.found, opened.accepted) == (8, 7)
    assert "stream action is 3 rows long, expected at least 4" in opened.refused[0].reason


def test_the_registered_task_brings_its_own_contract(tmp_path):
    task = load_task("tabletop_insertion")
    specs = task.episode_specs(3, 4)
    folder = tmp_path / "recordings"
    folder.mkdir()
    from genpolicy.data.recording.writer import write_episode

    first = task.record_episode(specs[0])
    assert isinstance(specs[0], EpisodeSpec)
    write_episode(folder / "e0.mcap", first)
    contract = propose(folder)
    assert contract.observation == task.observation
    assert contract.action_contract == TCP_ACTION
    assert contract.phases == list(task.phases)
    assert contract.ranges["tcp_position_m.z"][0] < contract.ranges["tcp_position_m.z"][1]
    assert len(contract.joint_range_rad or []) == 2
    assert contract.audit["reference_channel"] == "hole_pose"
    assert contract_of(contract.model_dump(), where="again") == contract
    with pytest.raises(BadInputError, match="1 accepted"):
        open_dataset(folder, out=tmp_path / "out")


def test_a_named_task_that_is_not_registered(recordings, tmp_path):
    with pytest.raises(BadInputError, match="juggling"):
        open_dataset(recordings, out=tmp_path / "out", task="juggling")


def test_a_contract_that_mcap_cannot_honour(recordings, tmp_path):
    contract = propose(recordings)
    cases = {
        "whole, in its order": {"columns": ["camera[1:5]"]},
        "SI units": {"unit": "mm"},
        "its own stream": {"columns": ["robot[0:4]"]},
    }
    for text, change in cases.items():
        channels = [contract.channels[0].model_copy(update=change), *contract.channels[1:]]
        edited = contract.model_copy(update={"channels": channels})
        with pytest.raises(BadInputError, match=text):
            open_dataset(recordings, out=tmp_path / "out", contract=edited)


def test_unreadable_ones_are_passed_over_and_refused(recordings, factory, tmp_path):
    (recordings / "a_first.mcap").write_bytes(b"\x89MCAP0\r\n and no more")
    bad = factory.episode(60, steps=14)
    values = np.array(bad.streams["robot"].values)
    values[5, 1] = np.nan
    factory.write_all(recordings, [factory.episode(i, steps=14) for i in range(6)])
    streams = {**bad.streams, "robot": replace(bad.streams["robot"], values=values)}
    factory.write_all(recordings / "..", [])
    from genpolicy.data.recording.writer import write_episode

    write_episode(recordings / "z.mcap", replace(bad, streams=streams))
    opened = open_dataset(recordings, out=tmp_path / "out")
    assert [r.file for r in opened.refused] == ["a_first.mcap", "z.mcap"]
    assert "row 5, column tcp_position_m.y is nan" in opened.refused[1].reason
    assert opened.found == opened.accepted + 2


def test_a_folder_without_a_usable_recording(factory, tmp_path):
    folder = tmp_path / "none"
    folder.mkdir()
    (folder / "x.mcap").write_bytes(b"")
    with pytest.raises(BadInputError, match=r"x\.mcap"):
        open_dataset(folder, out=tmp_path / "out")
    factory.write_all(folder, [factory.without_stream(factory.episode(0), "action")])
    (folder / "x.mcap").unlink()
    with pytest.raises(BadInputError, match="without an action stream"):
        open_dataset(folder, out=tmp_path / "out")
