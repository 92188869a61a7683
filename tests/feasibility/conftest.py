"""A tool that points down, straight chunks, and the context in which they are feasible."""

from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest

import genpolicy.tasks.tabletop_insertion as task_package
from genpolicy.contract.action import join_action
from genpolicy.contract.chunk import ChunkMetadata, Proposal
from genpolicy.feasibility.admission import FeasibilityChecker
from genpolicy.feasibility.context import Context
from genpolicy.feasibility.settings import FeasibilitySettings
from genpolicy.robot.scene_state import SceneState

SCENE = Path(task_package.__file__).with_name("scene.xml")
WORKSPACE = SimpleNamespace(lower_m=(0.30, -0.22, 0.02), upper_m=(0.72, 0.22, 0.28))
DOWN = np.diag([1.0, -1.0, -1.0])
HOME = np.array([0.0, -0.3, 0.0, -2.2, 0.0, 1.9, 0.785])
PERIOD_S = 0.05
K = 16


def scene(post_y_m=0.0, hole_xy_m=(0.65, 0.0), hole_yaw_rad=0.0):
    half = hole_yaw_rad / 2
    return SceneState(
        {
            "post": ((0.50, post_y_m, 0.11), (1.0, 0.0, 0.0, 0.0)),
            "fixture": ((*hole_xy_m, 0.0), (np.cos(half), 0.0, 0.0, np.sin(half))),
        }
    )


SCENE_STATE = scene()


def metadata(**changes):
    base = ChunkMetadata(
        chunk_id="c0", condition_observation_event_time_s=9.9, policy_checkpoint_hash="w",
        sampler_config_hash="s", action_start_time_s=10.0, action_period_s=PERIOD_S,
        valid_until_s=10.4, task_phase="approach", calibration_epoch="e0",
        predecessor_chunk_id="", session_epoch=1, method="bc", candidate_index=0,
    )  # fmt: skip
    return replace(base, **changes)


def smooth(n):
    """0 to 1 in n steps, with zero speed and acceleration at both ends."""
    s = np.arange(1, n + 1) / n
    return s**3 * (10 - 15 * s + 6 * s**2)


def line(start, end, *, opening=0.0, n=K):
    """Chunk along a straight line; `opening` may be one number per row."""
    start, end = np.asarray(start, float), np.asarray(end, float)
    position = start + smooth(n)[:, None] * (end - start)
    return join_action(position, np.broadcast_to(DOWN, (n, 3, 3)), np.asarray(opening, float))


def proposal(actions, **changes):
    return Proposal(metadata(**changes), actions, "first")


def context(checker, start, *, phase="approach", opening=0.0, history=2, **changes):
    """The arm stands still at `start`."""
    start = np.asarray(start, dtype=float)
    solved = checker.kinematics.solve_with_restarts(start[None], DOWN[None], q_seed_rad=HOME[None])
    assert solved.converged[0]
    q = solved.q_rad[0]
    base = Context(
        q_meas=q, q_cmd=q, last_action=join_action(start, DOWN, opening), now_s=10.0, phase=phase,
        calibration_epoch="e0", session_epoch=1, latest_observation_event_time_s=9.95,
        maximum_age_s=0.3, active_checkpoint_hash="w", active_sampler_hash="s",
        scene=SCENE_STATE, q_cmd_history=np.tile(q, (history, 1)),
    )  # fmt: skip
    return replace(base, **changes)


START = (0.37, 0.0, 0.15)
SIDE = (0.42, 0.12, 0.15)


def detour(side):
    """Out to one side of the post and past it; `side` is 1 (left) or -1 (right)."""
    n = K
    first = np.asarray(START) + smooth(n)[:, None] * (0.0, 0.0, 0.0)
    forward = smooth(2 * n)[n - 8 : 2 * n - 8]
    first[:, 0] = 0.37 + 0.10 * (forward - forward[0]) / (1 - forward[0])
    first[:, 1] = side * 0.125 * smooth(n)
    return join_action(first, np.broadcast_to(DOWN, (n, 3, 3)), np.asarray(0.0))


@pytest.fixture(scope="session")
def checker():
    return FeasibilityChecker(SCENE, workspace=WORKSPACE, settings=FeasibilitySettings())


@pytest.fixture(scope="session")
def build(checker):
    """Checkers with other settings or disabled checks; the slow parts are shared."""

    def make(*disabled, **changes):
        twin = object.__new__(FeasibilityChecker)
        twin.__dict__.update(checker.__dict__)
        twin.settings = FeasibilitySettings(**(checker.settings.model_dump() | changes))
        twin.disabled_checks = frozenset(disabled)
        twin._require_consistent()
        return twin

    return make


@pytest.fixture(scope="session")
def kit():
    """The helpers of this file, by name."""
    return SimpleNamespace(
        DOWN=DOWN, HOME=HOME, PERIOD_S=PERIOD_S, K=K, START=START, SIDE=SIDE, SCENE=SCENE,
        WORKSPACE=WORKSPACE, metadata=metadata, smooth=smooth, line=line, proposal=proposal,
        context=context, scene=scene, detour=detour,
    )  # fmt: skip
