"""A tool that points down, straight chunks, and the context in which they are feasible."""

import sys
from dataclasses import dataclass, field, replace
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest

from genpolicy.contract.action import join_action
from genpolicy.contract.chunk import ChunkMetadata, Projected, Proposal
from genpolicy.execution.checks import without
from genpolicy.feasibility.admission import FeasibilityChecker
from genpolicy.feasibility.batch import Batch
from genpolicy.feasibility.cell import cell_of
from genpolicy.feasibility.checks import CHECKS
from genpolicy.feasibility.context import Context
from genpolicy.feasibility.inverse import solved
from genpolicy.feasibility.settings import LAYERS, FeasibilitySettings
from genpolicy.robot.controller import CONTROLLER_MODE
from genpolicy.robot.scene_state import SceneState
from genpolicy.tasks.api import load_task

sys.path.insert(0, str(Path(__file__).parent))  # for what tests of this folder share

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
        controller_mode=CONTROLLER_MODE,
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


@dataclass(frozen=True)
class Outside:
    """A chunk that one check must refuse.

    Attributes:
        actions: The chunk. Shape (K, D_a).
        context: State at the check.
        metadata: Changes to its metadata.
        changes: What projection is said to have changed, m and rad.
        settings: Thresholds under which it is outside.
        others: Checks to leave out as well, so that it alone decides; None where a later check
            of the table refuses the chunk in any case.
    """

    actions: np.ndarray
    context: Context
    metadata: dict = field(default_factory=dict)
    changes: tuple[float, float] = (0.0, 0.0)
    settings: dict = field(default_factory=dict)
    others: tuple[str, ...] | None = ()


def judge(checker, actions, ctx, *, changes=(0.0, 0.0), **meta):
    """Verdict on actions as they are, without projection."""
    return checker.check(Projected(proposal(actions, **meta), actions, *changes), context=ctx)


def batch_of(*pairs):
    """Batch of actions and contexts, as they are."""
    chunks = tuple(Projected(proposal(actions), actions, 0.0, 0.0) for actions, _ in pairs)
    return Batch(chunks, tuple(ctx for _, ctx in pairs))


def turns_red(build, name, case):
    """Exactly this check refuses the case; a checker made without it does not."""
    arguments = {"changes": case.changes, **case.metadata}
    others = set(case.others or ()) - {name}
    verdict = judge(build(*others, **case.settings), case.actions, case.context, **arguments)
    assert verdict.first_reason == name, verdict.margins
    assert not verdict.passed
    layer = next(check.layer for check in CHECKS if check.name == name)
    assert verdict.first_layer == layer
    assert not verdict.layer(layer).margin >= 0
    behind = LAYERS[LAYERS.index(layer) + 1 :]
    assert [verdict.layer(n).passed for n in behind] == [None] * len(behind)
    mutant = build(name, *others, **case.settings)
    blind = judge(mutant, case.actions, case.context, **arguments)
    assert name not in blind.margins
    if case.others is None:  # a later barrier still stands: refused, but for another reason
        assert not blind.passed
        assert blind.first_reason != name
    else:
        assert blind.passed, (blind.first_reason, blind.detail)


def names_of(layer):
    """Checks of a layer."""
    return [check.name for check in CHECKS if check.layer == layer]


@pytest.fixture(scope="session")
def cell():
    """The default task's cell, with a higher ceiling than the task's."""
    task = load_task("tabletop_insertion")
    default = cell_of(task, FeasibilitySettings(), action_period_s=PERIOD_S)
    return replace(default, workspace=WORKSPACE)


@pytest.fixture(scope="session")
def checker(cell):
    return FeasibilityChecker(cell)


@pytest.fixture(scope="session")
def build(cell):
    """Checkers without some checks, or with other settings; the slow parts are shared."""

    def make(*names, **changes):
        settings = FeasibilitySettings(**(cell.settings.model_dump() | changes))
        return FeasibilityChecker(replace(cell, settings=settings), checks=without(CHECKS, *names))

    return make


@pytest.fixture(scope="session")
def kit():
    """The helpers of this file, by name."""
    return SimpleNamespace(
        DOWN=DOWN, HOME=HOME, PERIOD_S=PERIOD_S, K=K, START=START, SIDE=SIDE, WORKSPACE=WORKSPACE,
        metadata=metadata, smooth=smooth, line=line, proposal=proposal, context=context,
        scene=scene, detour=detour, judge=judge, batch_of=batch_of, turns_red=turns_red,
        Outside=Outside, names_of=names_of, solved=solved,
    )  # fmt: skip
