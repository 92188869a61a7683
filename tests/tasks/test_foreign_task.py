"""A task outside the tree goes the whole way: nothing on it was written for the default task."""

import shutil
from types import SimpleNamespace

import numpy as np
import pytest

from gates.evidence import Evidence
from gates.pages import plots_scene
from genpolicy.audit.evidence import write_evidence
from genpolicy.audit.settings import AuditSettings
from genpolicy.contract.action import GRIPPER, split_action
from genpolicy.data.contract import TCP_ACTION, IngestContract, plausible_ranges
from genpolicy.data.dataset import load_dataset
from genpolicy.data.ingest import ingest_recordings
from genpolicy.evidence.admission_context import make_checker
from genpolicy.evidence.need.audit_task import audit_task, round_obstacles, settings_of
from genpolicy.evidence.need.pictures import scene_png
from genpolicy.evidence.shadow.corruption import CORRUPTIONS
from genpolicy.evidence.shadow.layer_mutants import missing_checks_evidence
from genpolicy.evidence.shadow.observations import held_out_observations
from genpolicy.evidence.shadow.shadow import Shadow, admit, case_of
from genpolicy.evidence.shadow.tables import all_mutants
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
from genpolicy.feasibility.admission import Admitted, Rejected
from genpolicy.feasibility.figures import expected_motion
from genpolicy.feasibility.settings import FeasibilitySettings
from genpolicy.seeds import stream
from genpolicy.tasks.api import load_task
from genpolicy.tasks.demonstrations import record_session
from genpolicy.verification.checker import check_journal

EPISODES, ROLLOUTS, SEED = 12, 10, 3
NOTHING_HELD = ("payload_torque", "contact_surface", "contact_force")
"""Checks that are asked of no task whose hand holds nothing."""


@pytest.fixture(scope="module")
def cell(foreign_task, kit, tmp_path_factory):
    """The task, recorded and ingested, and what checks and executes it."""
    task = load_task(foreign_task)
    root = tmp_path_factory.mktemp("foreign")
    (root / "episodes").mkdir()
    names = record_session(
        foreign_task, root_seed=SEED, episodes=EPISODES, shares=None, folder=root / "episodes",
        workers=1, scheduler="local",
    )  # fmt: skip
    limits = task.limits
    contract = IngestContract(
        observation=task.observation,
        phases=task.phases,
        action_period_s=kit.HORIZONS.action_period_s,
        joint_range_rad=(
            tuple(limits.position_lower_rad.tolist()), tuple(limits.position_upper_rad.tolist()),
        ),
        ranges=plausible_ranges(
            task.observation, TCP_ACTION,
            workspace_lower_m=np.array(task.workspace.lower_m),
            workspace_upper_m=np.array(task.workspace.upper_m),
        ),
    )  # fmt: skip
    ingest_recordings(
        [root / "episodes" / name for name in names], contract=contract, out=root / "dataset"
    )
    feasibility = FeasibilitySettings(**kit.PARAMS["feasibility"])
    execution = ExecutionSettings(
        **kit.PARAMS["execution"]
        | {
            "force_limit_n": dict.fromkeys(task.phases, 40.0),
            "late_chunk": {"hold": list(task.phases)},
            "recovery_plans": {"default": ["retreat"]},
        }
    )
    checker = make_checker(task, feasibility, action_period_s=kit.HORIZONS.action_period_s)
    return SimpleNamespace(
        task=task, root=root, names=names, data=load_dataset(root / "dataset"), checker=checker,
        feasibility=feasibility, execution=execution, horizons=kit.HORIZONS,
    )  # fmt: skip


@pytest.fixture(scope="module")
def shadow(cell):
    return Shadow(
        task=cell.task, checker=cell.checker, cell=Cell(cell.horizons, cell.execution),
        late_rows=1, samples=2,
    )  # fmt: skip


@pytest.fixture(scope="module")
def good(shadow, cell):
    """Demonstrated chunks that are admitted as they are, with their phase."""
    items = held_out_observations(
        cell.data, horizons=cell.horizons, count=45, generator=stream(1, "foreign")
    )
    cases = [
        (item.phase, case_of(shadow, item, item.demonstrated, number=number))
        for number, item in enumerate(items)
    ]
    found = [(phase, case) for phase, case in cases if isinstance(admit(shadow, case), Admitted)]
    assert {phase for phase, _ in found} == set(cell.task.phases)
    assert len(found) >= 0.8 * len(cases)
    return found


def test_every_recording_is_accepted_and_succeeds(cell):
    assert cell.data.manifest["counts"] == {
        "accepted": EPISODES, "found": EPISODES, "refused": 0,
        "rows": len(cell.data.frames.action),
    }  # fmt: skip
    assert set(cell.data.episodes["outcome"]) == {"success"}


def test_a_robot_without_a_gripper_has_a_constant_zero_there(cell):
    assert not np.any(cell.data.frames.action[:, GRIPPER])
    _, rotation, opening = split_action(cell.data.frames.action)
    assert not np.any(opening) and np.isfinite(rotation).all()


def test_the_robot_is_read_from_the_scene(cell):
    assert cell.checker.kinematics.joint_count == 6
    assert cell.checker.collision.shapes.target_body == "pad"
    assert cell.checker.cell.limits is cell.task.limits
    held, scene = cell.checker.collision.shapes.held_reach_m, cell.checker.collision.shapes.scene
    assert held == 0.0
    assert {shape.body for shape in scene} == {"world", "pillar", "pad"}


def test_the_audit_reads_the_tasks_own_channels(cell, kit, tmp_path):
    few = AuditSettings(neighbours=4, minimum_neighbours=4, query_stride=8)
    settings = settings_of(few, cell.task, cell.horizons, confidence=0.95)
    result = audit_task(
        cell.root / "dataset", task_name=cell.task.name, settings=settings,
        feasibility=cell.feasibility, action_period_s=cell.horizons.action_period_s, root_seed=SEED,
    )  # fmt: skip
    assert result is not None
    (pillar,) = round_obstacles(cell.task)
    assert vars(pillar) == pytest.approx({"x_m": 0.44, "y_m": 0.0, "radius_m": 0.02})
    shutil.copytree(cell.root / "dataset", tmp_path / "artifacts/ingest")
    (tmp_path / "artifacts/audit").mkdir()
    write_evidence(result, tmp_path / "artifacts/audit", settings=settings, obstacles=[pillar])
    # Two bundles, and too few episodes for the audit to tell them: nobody else does.
    assert _drawn_demonstrations(tmp_path) == [
        "end of a failure (0)", f"no mode: {EPISODES} episodes, {EPISODES} succeed", "obstacle",
    ]  # fmt: skip


def _drawn_demonstrations(root):
    """What the legend of Gate A's figure of the demonstrations says."""
    figure = plots_scene.PLOTS[1].draw(Evidence(root), None)
    return sorted(text.get_text() for text in figure.legends[0].get_texts())


def test_its_picture_is_its_own_and_the_same_every_time(cell):
    first = scene_png(cell.task.name)
    assert first == scene_png(cell.task.name)
    assert first.startswith(b"\x89PNG")
    assert first != scene_png("tabletop_insertion")


@pytest.mark.parametrize("corruption", CORRUPTIONS, ids=lambda item: item.name)
def test_every_corruption_is_refused_by_the_layer_that_owns_it(corruption, good, shadow):
    cases = [corruption.apply(case, shadow.checker) for _, case in good[::4]]
    cases = [case for case in cases if case is not None]
    if corruption.check in NOTHING_HELD:
        assert cases == [] and corruption.applicable(shadow.checker.cell, shadow.task.obstacles)
        return
    assert cases, "the corruption could be applied nowhere"
    results = [admit(shadow, case) for case in cases]
    assert all(isinstance(result, Rejected) for result in results)
    assert corruption.behind or corruption.layer in {r.verdict.first_layer for r in results}


def test_every_check_left_out_is_noticed(shadow, cell):
    items = held_out_observations(
        cell.data, horizons=cell.horizons, count=6, generator=stream(2, "foreign")
    )
    rows = missing_checks_evidence(shadow, items)
    assert [row.check for row in rows if not row.detected] == list(NOTHING_HELD)
    excused = {row.check: row.not_applicable for row in rows if row.not_applicable}
    assert set(excused) == set(NOTHING_HELD)
    assert set(excused.values()) == {"the task's hand holds nothing"}


def test_every_mutant_is_found():
    assert all(row.detected for row in all_mutants([]))


def test_ten_rollouts_of_the_scripted_operator(cell, tmp_path):
    specs = cell.task.episode_specs(SEED + 1, ROLLOUTS)
    plans = [cell.task.record_episode(spec).streams["action"].values for spec in specs]
    terms = {name: np.full(8, 0.03 / len(MEASURED_TERMS)) for name in MEASURED_TERMS}
    declared = {name: DeclaredTerm(0.001, 0.002) for name in DECLARED_TERMS}
    setup = Setup(
        task=cell.task, checker=cell.checker, horizons=cell.horizons, execution=cell.execution,
        latency=LatencyModel(declared, terms, 0.0), perturbation="nominal",
        schedule=Nominal(), root_seed=SEED, method="scripted",
        checkpoint="w" * 64, sampler="s" * 64,
    )  # fmt: skip
    rollouts = [
        Rollout(setup, spec.start, number, calibration_epoch=cell.task.calibration_epochs[0])
        for number, spec in enumerate(specs)
    ]
    policy = Operator(plans, rollouts, cell.horizons.prediction_horizon)
    for _ in range(220):
        active = [rollout for rollout in rollouts if not rollout.done]
        if not active:
            break
        step(active, policy, samples=1)
    for rollout in rollouts:
        rollout.end(Outcome.TIMEOUT)
    modes = [cell.task.mode_of(np.array(r.tally.path_m), r.world.observe()) for r in rollouts]
    assert modes == [spec.mode for spec in specs]
    assert [r.outcome for r in rollouts] == [Outcome.SUCCESS] * ROLLOUTS
    journal = tmp_path / "journal.mcap"
    write_journal(journal, [rollout.journal for rollout in rollouts])
    task = rollouts[0].setup.task
    motion = expected_motion(cell.checker.cell, task.action_at, task.scene_poses)
    report = check_journal(journal, expected_settings(Cell(cell.horizons, cell.execution)), motion)
    assert not report.violations and report.reproved_actions > 100


class Operator:
    """Goes on with the demonstrated plan from where the last command left it."""

    stochastic = False

    def __init__(self, plans, rollouts, horizon):
        self.plans, self.horizon = plans, horizon
        self.rollouts = {rollout.start_index: rollout for rollout in rollouts}
        self.place = dict.fromkeys(self.rollouts, 0)

    def sample(self, observations, *, noise_names, candidates, prefix=None):
        return SimpleNamespace(actions=[self._plan(name[2]) for name in noise_names], nfe=1)

    def _plan(self, number):
        plan, rollout = self.plans[number], self.rollouts[number]
        near = plan[self.place[number] : self.place[number] + 12]
        distance = np.linalg.norm(near - rollout.world.last_action, axis=1)
        # The last of the nearest: a plan that rests is gone through, not waited in.
        self.place[number] += int(np.flatnonzero(distance <= distance.min() + 1e-6)[-1])
        steps = np.ones(self.horizon)
        steps[:5] = (0.0, 0.25, 0.5, 0.75, 1.0) if self.rests(rollout) else steps[:5]
        index = np.minimum(self.place[number] + np.cumsum(steps), len(plan) - 1)
        low = np.floor(index).astype(int)
        share = (index - low)[:, None]
        return ((1 - share) * plan[low] + share * plan[np.minimum(low + 1, len(plan) - 1)])[None]

    def rests(self, rollout):
        """Whether the arm stood still since the last plan: then it must start gently."""
        now = (rollout.tally.hold_ticks, rollout.world.phase)
        before = self.__dict__.setdefault("seen", {}).get(rollout.start_index, (-1, ""))
        self.seen[rollout.start_index] = now
        return now != before
