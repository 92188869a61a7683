"""A rollout as a viewer sees it: the arm where it was measured, its force, what was refused."""

import dataclasses
from types import SimpleNamespace

import numpy as np
import pytest

from genpolicy.contract.rotation import rotation_from_6d
from genpolicy.errors import IntegrityError
from genpolicy.evidence.rows.stress import RefusedRow
from genpolicy.evidence.shadow.candidate_rows import numbers_sha256
from genpolicy.execution.journal import Event
from genpolicy.integrity.rows import write_rows
from genpolicy.replay.film import film_of
from genpolicy.replay.panels import panels
from genpolicy.replay.proposals import REFUSED, Proposals
from genpolicy.replay.timeline import JOINTS_MEASURED, MEASURED_FRAME, ROBOT, TRANSFORMS, Timeline

LABELS = {"method": "flow", "perturbation": "push", "start": "3"}
NOBODY = SimpleNamespace(rejected=lambda _: None)


def state(cell, t_ms, n, q_rad, force_n=0.0, opening=0.02):
    position, rotation = cell.collision.kinematics.forward(q_rad)
    payload = {
        "q_rad": q_rad.tolist(), "tcp_m": position.tolist(),
        "tcp_rotation": [*rotation[:, 0], *rotation[:, 1]], "gripper_m": opening,
        "force_n": force_n,
    }  # fmt: skip
    return Event("s", n, "state", t_ms * 1_000_000, payload)


@pytest.fixture
def moving(cell, task):
    """Three states, of which the second one is another pose and feels something."""
    there = task.posture_rad + 0.1
    return [
        state(cell, 0, 1, task.posture_rad),
        state(cell, 100, 2, there, force_n=4.5),
        state(cell, 200, 3, there),
    ]


def test_the_arm_stands_where_it_was_measured_at_every_tick(cell, moving):
    shown = list(Timeline(cell, NOBODY, "s").messages(moving))
    joints = [item for item in shown if item.topic == JOINTS_MEASURED]
    assert [item.time_ns for item in joints] == [event.t for event in moving]
    for item, event in zip(joints, moving, strict=True):
        np.testing.assert_allclose(item.content["position_rad"], event.payload["q_rad"], atol=1e-6)
    frames = [item.content for item in shown if item.topic == TRANSFORMS]
    assert [one["child_frame_id"] for one in frames] == [MEASURED_FRAME] * 3
    last = moving[-1].payload
    assert list(frames[-1]["translation"].values()) == pytest.approx(last["tcp_m"], abs=1e-6)
    robots = [item.content["entities"] for item in shown if item.topic == ROBOT]
    assert len(robots) == 3
    bare = [[{**one, "timestamp": 0} for one in robot] for robot in robots]
    assert bare[0] != bare[1] == bare[2]


def test_a_film_shows_the_measured_hand_and_every_force(cell, moving):
    film = film_of(cell, moving)
    assert film.forces == ((0.1, 4.5),)
    assert film.path_m.shape == (0, 3)  # nothing was commanded
    moved = [frame.hand[0].mean(axis=0) for frame in film.frames]
    away = np.array(moving[1].payload["tcp_m"]) - np.array(moving[0].payload["tcp_m"])
    assert np.linalg.norm(moved[1] - moved[0]) > np.linalg.norm(away[:2]) / 2
    np.testing.assert_array_equal(moved[1], moved[2])
    turned = rotation_from_6d(np.array(moving[0].payload["tcp_rotation"]))
    assert np.allclose(turned @ turned.T, np.eye(3))


def test_the_layout_draws_force_and_terms(task):
    topics = ["/journal/state", "/journal/latency"]
    layout = panels(topics, joint_count=7, workspace=task.workspace)["configById"]
    assert [path["value"] for path in layout["Plot!force"]["paths"]] == ["/journal/state.force_n"]
    terms = [path["value"] for path in layout["Plot!latency"]["paths"]]
    assert len(terms) == 11 and "/journal/latency.sample_s" in terms


RAW, PROJECTED = np.arange(20.0), np.arange(20.0) + 0.5
ROW = RefusedRow(
    method="flow", seed=0, perturbation="push", start=3, chunk_id="c/4", candidate=1,
    layer="geometric", first_reason="collision", first_row=1, layer_margin=-0.004, margin_unit="m",
    touching=("hand", "post"), raw=tuple(RAW), projected=tuple(PROJECTED),
)  # fmt: skip


def candidate(**changes):
    layers = {"representation": True, "kinematic": True, "geometric": False}
    measures = {"raw_sha256": numbers_sha256(RAW), "projected_sha256": numbers_sha256(PROJECTED)}
    return {"chunk_id": "c/4", "index": 1, "layers": layers, "first_reason": "collision",
            "measures": measures, **changes}  # fmt: skip


@pytest.fixture
def proposals(tmp_path):
    others = [
        dataclasses.replace(ROW, start=2), dataclasses.replace(ROW, perturbation="nominal"),
        dataclasses.replace(ROW, chunk_id="c/5"),
    ]  # fmt: skip
    write_rows(tmp_path / REFUSED, RefusedRow, [*others, ROW])
    return Proposals(tmp_path / "journals", LABELS)


def test_what_was_refused_in_a_rollout_has_its_numbers_and_its_reason(proposals):
    found = proposals.rejected(candidate())
    np.testing.assert_array_equal(found.raw.ravel(), RAW)
    np.testing.assert_array_equal(found.judged.ravel(), PROJECTED)
    assert (found.row, found.margin, found.touching) == (1, -0.004, ("hand", "post"))
    assert found.said.endswith("hand and post touch")


def test_of_a_rollout_that_is_not_kept_only_the_reason_is_known(proposals, tmp_path):
    for found in (
        proposals.rejected(candidate(index=2)),
        Proposals(tmp_path / "journals", {**LABELS, "start": "9"}).rejected(candidate()),
        Proposals(tmp_path / "elsewhere" / "journals", LABELS).rejected(candidate()),
    ):
        assert (found.reason, found.raw, found.row, found.touching) == ("collision", None, None, ())


def test_a_chunk_that_the_journal_does_not_state_is_refused(proposals):
    measures = {"raw_sha256": numbers_sha256(PROJECTED), "projected_sha256": "0"}
    with pytest.raises(IntegrityError, match="raw of candidate 1"):
        proposals.rejected(candidate(measures=measures))
