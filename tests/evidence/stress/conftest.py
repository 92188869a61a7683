"""The real cell, scripted policies in place of trained ones, and a lockstep driver."""

from dataclasses import dataclass
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest

from genpolicy.contract.horizons import HorizonConfig
from genpolicy.evidence.admission_context import make_checker
from genpolicy.evidence.stress.latency import (
    DECLARED_TERMS,
    MEASURED_TERMS,
    DeclaredTerm,
    LatencyModel,
)
from genpolicy.evidence.stress.matched import step
from genpolicy.evidence.stress.perturbations import Nominal
from genpolicy.evidence.stress.rollout import Rollout
from genpolicy.evidence.stress.state import Outcome, Setup
from genpolicy.execution.cell import Cell, ExecutionSettings
from genpolicy.execution.figures import expected_settings
from genpolicy.execution.journal import write_journal
from genpolicy.feasibility.figures import expected_motion
from genpolicy.feasibility.settings import FeasibilitySettings
from genpolicy.integrity.documents import read_yaml
from genpolicy.tasks.api import load_task
from genpolicy.tasks.tabletop_insertion.episodes import demonstrate
from genpolicy.verification.checker import check_journal

PARAMS = read_yaml(Path(__file__).parents[3] / "params.yaml")
HORIZONS = HorizonConfig(**PARAMS["horizons"])
# Whole answers: what single terms may take is asked in `test_term_deadlines`.
EXECUTION = ExecutionSettings(**PARAMS["execution"] | {"term_deadlines": []})
FEASIBILITY = FeasibilitySettings(**PARAMS["feasibility"])
ROOT_SEED = 7
EPOCH = "epoch_1"


def latency(seconds=0.03, *, cold_extra_s=0.0):
    """A model whose compute terms sum to `seconds`; sensor and network terms to 6 to 12 ms."""
    return LatencyModel(
        {name: DeclaredTerm(0.001, 0.002) for name in DECLARED_TERMS},
        {name: np.full(8, seconds / len(MEASURED_TERMS)) for name in MEASURED_TERMS},
        cold_extra_s,
    )


@dataclass
class Scripted:
    """A policy that answers with `plan(rollout)`, candidates of shape (N, K, D_a)."""

    plan: object
    rollouts: dict
    stochastic: bool = False

    def sample(self, observations, *, noise_names, candidates, prefix=None):
        """Chunks of the rollouts that the noise names name by their start."""
        chunks = [np.asarray(self.plan(self.rollouts[name[2]])) for name in noise_names]
        return SimpleNamespace(actions=chunks, nfe=1)


def drive(rollouts, plan, *, ticks=300):
    """Advance rollouts in lockstep under a scripted policy until all have ended."""
    policy = Scripted(plan, {rollout.start_index: rollout for rollout in rollouts})
    for _ in range(ticks):
        active = [rollout for rollout in rollouts if not rollout.done]
        if not active:
            break
        step(active, policy, samples=1)
    for rollout in rollouts:
        rollout.end(Outcome.TIMEOUT)
    return rollouts


def drive_one(rollout, plan):
    """One tick of one rollout under a scripted policy."""
    step([rollout], Scripted(plan, {rollout.start_index: rollout}), samples=1)


class Replay:
    """Goes on with a demonstrated plan where the last command left it; starts gently from rest.

    From rest the row that the latency skips repeats the last command, and the plan is resumed at
    growing speed, as an operator would.
    """

    def __init__(self, plans):
        self.plans = plans
        self.memory = {}

    def __call__(self, rollout):
        actions = self.plans[rollout.start_index]
        place, holds, phase = self.memory.get(rollout.start_index, (0, -1, ""))
        near = actions[place : place + 12]
        distance = np.linalg.norm(near - rollout.world.last_action, axis=1)
        place += int(np.argmin(distance))
        tally = rollout.tally
        rests = holds != tally.hold_ticks or phase != rollout.world.phase
        steps = np.ones(HORIZONS.prediction_horizon)
        if rests:
            steps[:5] = (0.0, 0.25, 0.5, 0.75, 1.0)
        self.memory[rollout.start_index] = (place, tally.hold_ticks, rollout.world.phase)
        index = np.minimum(place + np.cumsum(steps), len(actions) - 1)
        low = np.floor(index).astype(int)
        share = (index - low)[:, None]
        high = np.minimum(low + 1, len(actions) - 1)
        return ((1 - share) * actions[low] + share * actions[high])[None]


def straight(rollout):
    """Gently from the last command straight ahead in x: through the post."""
    last = rollout.world.last_action
    chunk = np.tile(last, (HORIZONS.prediction_horizon, 1))
    chunk[:, 0] += np.cumsum(np.minimum(0.012, 0.003 * np.arange(len(chunk))))
    return chunk[None]


def check(rollouts, folder, *, execution=EXECUTION):
    """Write the journals and let the independent checker read them back."""
    path = folder / "journal.mcap"
    write_journal(path, [rollout.journal for rollout in rollouts])
    setup = rollouts[0].setup if rollouts else None
    task = setup and setup.task
    motion = setup and expected_motion(setup.checker.cell, task.action_at, task.scene_poses)
    return check_journal(path, expected_settings(Cell(HORIZONS, execution)), motion)


@pytest.fixture(scope="session")
def task():
    return load_task("tabletop_insertion")


@pytest.fixture(scope="session")
def checker(task):
    return make_checker(task, FEASIBILITY, action_period_s=HORIZONS.action_period_s)


@pytest.fixture(scope="session")
def plans(task):
    """Three demonstrations without incident: their specs and what the operators commanded."""
    specs = task.episode_specs(5, 3, shares={"nominal": 1.0})
    done = [demonstrate(spec) for spec in specs]
    assert all(item.success for item in done)
    return SimpleNamespace(
        specs=specs,
        starts=[spec.start for spec in specs],
        actions={number: item.actions for number, item in enumerate(done)},
    )


@pytest.fixture(scope="session")
def make_fixture(task, checker):
    """Fixtures of the cell; keywords replace its parts."""

    def make(**changes):
        parts = {
            "task": task, "checker": checker, "horizons": HORIZONS, "execution": EXECUTION,
            "latency": latency(), "perturbation": "nominal",
            "schedule": Nominal(), "root_seed": ROOT_SEED,
            "method": "scripted", "checkpoint": "w" * 64, "sampler": "s" * 64,
        }  # fmt: skip
        return Setup(**(parts | changes))

    return make


@pytest.fixture(scope="session")
def run(make_fixture, plans):
    """Rollouts of some of the planned starts under a scripted policy, to their end."""

    def go(plan, *, starts=(0,), ticks=300, **changes):
        setup = make_fixture(**changes)
        rollouts = [
            Rollout(setup, plans.starts[number], number, calibration_epoch=EPOCH)
            for number in starts
        ]
        return drive(rollouts, plan, ticks=ticks)

    return go


@pytest.fixture(scope="session")
def kit():
    """The helpers of this file, by name."""
    return SimpleNamespace(
        HORIZONS=HORIZONS, EXECUTION=EXECUTION, FEASIBILITY=FEASIBILITY, ROOT_SEED=ROOT_SEED,
        EPOCH=EPOCH, PARAMS=PARAMS, latency=latency, drive=drive, drive_one=drive_one,
        Replay=Replay,
        straight=straight, check=check,
    )  # fmt: skip
