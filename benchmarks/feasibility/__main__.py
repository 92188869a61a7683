"""Feasibility of 32 candidates of 16 actions: processor ms, and the ratio to a plain FCL loop.

The plain loop places every shape and asks FCL about every pair, one Python call each, at every
action (and at five configurations per motion for the swept figure). Both answer for the same
configurations in the same run, and must agree on the actions. What it takes to judge one invocation
of 1, 8 and 32 candidates (projection and six layers) is said as median and p95 of wall time, beside
the plain reference: the same projection and layers in numpy, with nothing compiled
(`benchmarks.feasibility.plain.PlainChecker`), and beside the straightforward way, meshes and
inverse kinematics from scratch per action (`benchmarks.feasibility.straightforward`). Nothing is
multiplied: every sub-sample that is told was asked.

    python -m benchmarks.feasibility [--invocations 200] [--candidates 32]
"""

import argparse
import time
from collections.abc import Callable
from dataclasses import replace
from types import SimpleNamespace

import fcl
import numpy as np

from benchmarks.feasibility.plain import PlainChecker, plain_cell
from benchmarks.feasibility.straightforward import SUB_SAMPLES, Straightforward
from genpolicy.contract.action import GRIPPER, join_action
from genpolicy.contract.chunk import ChunkMetadata, Proposal
from genpolicy.feasibility.admission import Admitted, FeasibilityChecker
from genpolicy.feasibility.cell import cell_of
from genpolicy.feasibility.context import Context
from genpolicy.feasibility.settings import FeasibilitySettings
from genpolicy.robot.collision import CollisionModel, Paths
from genpolicy.robot.controller import CONTROLLER_MODE
from genpolicy.robot.scene_state import SceneState
from genpolicy.robot.shapes import fcl_geometry
from genpolicy.tasks.api import load_task

WORKSPACE = SimpleNamespace(lower_m=(0.30, -0.22, 0.02), upper_m=(0.72, 0.22, 0.28))
CANDIDATES, ACTIONS, PERIOD_S, JITTER_M = 32, 16, 0.05, 0.001
DOWN = np.diag([1.0, -1.0, -1.0])
INVOKED, LIMIT_MS = (1, 8, CANDIDATES), 10.0
"""Candidates of one invocation, and what the p95 of the last is to keep to."""


def chunks(rng: np.random.Generator, count: int = CANDIDATES) -> np.ndarray:
    """Detours to both sides of the post, one in eight straight at it, with jitter. (B, n, 10)."""
    s = np.arange(1, ACTIONS + 1) / ACTIONS
    ease = s**3 * (10 - 15 * s + 6 * s**2)
    side = np.where(np.arange(count) % 8 == 0, 0.0, np.where(rng.random(count) < 0.5, -1, 1))
    position = np.zeros((count, ACTIONS, 3))
    position[..., 0] = 0.37 + np.where(side == 0, 0.1, 0.07)[:, None] * ease
    position[..., 1] = side[:, None] * 0.12 * ease
    position[..., 2] = 0.15
    position += rng.normal(0, JITTER_M, position.shape)
    rotation = np.broadcast_to(DOWN, (count, ACTIONS, 3, 3))
    return join_action(position, rotation, np.zeros((count, ACTIONS)))


def context(checker: FeasibilityChecker) -> Context:
    """The arm at rest before the post."""
    start = np.array([0.37, 0.0, 0.15])
    home = np.array([[0.0, -0.3, 0.0, -2.2, 0.0, 1.9, 0.785]])
    q = checker.kinematics.solve(start[None], DOWN[None], q_seed_rad=home).q_rad[0]
    return Context(
        q_meas=q, q_cmd=q, last_action=join_action(start, DOWN, 0.0), now_s=10.0, phase="approach",
        calibration_epoch="e0", session_epoch=1, latest_observation_event_time_s=9.95,
        maximum_age_s=0.3, active_checkpoint_hash="w", active_sampler_hash="s",
        scene=SceneState(), q_cmd_history=np.tile(q, (2, 1)), controller_mode=CONTROLLER_MODE,
    )  # fmt: skip


def proposal(actions: np.ndarray, index: int) -> Proposal:
    """A fresh proposal of the actions."""
    return Proposal(
        ChunkMetadata(
            chunk_id=f"c{index}", condition_observation_event_time_s=9.9,
            policy_checkpoint_hash="w", sampler_config_hash="s", action_start_time_s=10.0,
            action_period_s=PERIOD_S, valid_until_s=10.4, task_phase="approach",
            calibration_epoch="e0", predecessor_chunk_id="", session_epoch=1, method="bench",
            candidate_index=index,
        ),
        actions, "first",
    )  # fmt: skip


class PlainLoop:
    """Every pair of every configuration, one FCL call each."""

    def __init__(self, model: CollisionModel) -> None:
        self.model = model
        self.robot = [
            fcl.CollisionObject(fcl_geometry(s, inflation_m=0.0)) for s in model.shapes.robot
        ]
        self.scene = [
            fcl.CollisionObject(fcl_geometry(s, inflation_m=0.0)) for s in model.shapes.scene
        ]
        columns, self.pairs = model.broad.columns, []
        for shape, body, other in zip(columns.shape, columns.body, columns.other, strict=True):
            if body < 0:
                self.pairs.append((self.robot[shape], self.robot[other]))
            else:
                self.pairs += [
                    (self.robot[shape], self.scene[i])
                    for i, s in enumerate(model.shapes.scene) if s.body == model.bodies[body]
                ]  # fmt: skip
        for target, (rotation, position) in zip(
            self.scene, model.scene_placements(SceneState()), strict=True
        ):
            target.setTransform(fcl.Transform(rotation, position))

    def hits(self, q: np.ndarray) -> bool:
        """Whether any pair touches."""
        placements = self.model.placements(q, opening_m=0.01)
        for target, (rotation, position) in zip(self.robot, placements, strict=True):
            target.setTransform(fcl.Transform(rotation, position))
        request, found = fcl.CollisionRequest(), False
        for first, second in self.pairs:  # no early exit: the cost of clearing everything
            found |= fcl.collide(first, second, request, fcl.CollisionResult()) > 0
        return found


def median_ms(work: Callable[[], object], repeats: int) -> float:
    """Median processor time of some repeats, after one that does not count, ms."""
    work()
    times = []
    for _ in range(repeats):
        begin = time.process_time()
        work()
        times.append(time.process_time() - begin)
    return 1e3 * float(np.median(times))


def invocations(
    checker: FeasibilityChecker, proposals: list[Proposal], ctx: Context, *, count: int
) -> None:
    """Print median and p95 of judging one invocation, and the ratios to the plain reference."""
    theirs = PlainChecker(checker.cell)

    def plainly(some: list[Proposal]) -> object:
        projected = theirs.project_many(some, [ctx] * len(some))
        return theirs.check_many(projected, [ctx] * len(some))

    print(f"one invocation, wall ms, median and p95 of {count} (plain: of {max(count // 10, 2)})")
    for size in sorted({min(size, len(proposals)) for size in INVOKED}):
        some = proposals[:size]
        ours = spread_ms(lambda: checker.admit_many(some, [ctx] * len(some)), count)  # noqa: B023
        plain = spread_ms(lambda: plainly(some), max(count // 10, 2))  # noqa: B023
        within = f", limit {LIMIT_MS:g}" if size == CANDIDATES else ""
        print(
            f"{size:3d} candidates: {ours[0]:.2f}, p95 {ours[1]:.2f}{within}; "
            f"plain {plain[0]:.1f}, p95 {plain[1]:.1f}; {plain[0] / ours[0]:.1f} times by medians"
        )


def straightforwardly(
    checker: FeasibilityChecker, proposals: list[Proposal], ctx: Context, *, count: int
) -> None:
    """Print what the straightforward way takes, and how often it says another thing."""
    cell = plain_cell(checker.cell)
    way = Straightforward(cell.kinematics, cell.collision, ctx.scene)
    opening_m = cell.collision.shapes.held_half_width_m

    def judged() -> list[bool]:
        rows = (p.actions for p in proposals)
        return [way.passes(r, q_cmd_rad=ctx.q_cmd, opening_m=opening_m) for r in rows]

    begin = time.process_time()  # one pass of seconds; wall time would be that of other programs
    passed = judged()
    theirs_ms = 1e3 * (time.process_time() - begin)
    contexts = [ctx] * len(proposals)
    ours_ms = median_ms(lambda: checker.admit_many(proposals, contexts), count)
    admitted = [isinstance(one, Admitted) for one in checker.admit_many(proposals, contexts)]
    beside = sum(ours and not theirs for ours, theirs in zip(admitted, passed, strict=True))
    print(
        f"straightforward, meshes: {len(proposals)} candidates, {way.asked.solved} poses solved "
        f"and {way.asked.configurations} configurations asked once, in {theirs_ms:.0f} ms of the "
        f"processor; six layers {ours_ms:.2f} ms; {theirs_ms / ours_ms:.0f} times"
    )
    print(f"it refuses {beside} of the {sum(admitted)} that the layers admit")


def between(q: np.ndarray, q_cmd: np.ndarray) -> np.ndarray:
    """Configurations on the way to each action of each chunk, all in a row. Shape (N, J)."""
    path = np.concatenate([np.tile(q_cmd, (len(q), 1, 1)), q], axis=1)
    shares = np.arange(1, SUB_SAMPLES + 1) / (SUB_SAMPLES + 1)
    steps = path[:, :-1, None] + shares[:, None] * np.diff(path, axis=1)[:, :, None]
    return np.asarray(steps.reshape(-1, q.shape[-1]))


def spread_ms(work: Callable[[], object], repeats: int) -> tuple[float, float]:
    """Median and 95th percentile of the wall time, after one that does not count, ms."""
    work()
    times = []
    for _ in range(repeats):
        begin = time.perf_counter()
        work()
        times.append(time.perf_counter() - begin)
    median, high = np.quantile(times, (0.5, 0.95), method="higher")
    return 1e3 * float(median), 1e3 * float(high)


def main(arguments: list[str] | None = None) -> None:
    """Print the figures."""
    parser = argparse.ArgumentParser(description=__doc__.split("\n", maxsplit=1)[0])
    parser.add_argument("--invocations", type=int, default=200)
    parser.add_argument("--candidates", type=int, default=CANDIDATES)
    asked = parser.parse_args(arguments)
    task = load_task("tabletop_insertion")
    cell = cell_of(task, FeasibilitySettings(), action_period_s=PERIOD_S)
    checker = FeasibilityChecker(replace(cell, workspace=WORKSPACE))
    ctx = context(checker)
    drawn = chunks(np.random.default_rng(1), asked.candidates)
    proposals = [proposal(a, i) for i, a in enumerate(drawn)]
    contexts = [ctx] * len(proposals)
    projected = checker.project_many(proposals, contexts)
    results = checker.admit_many(proposals, contexts)
    print(f"{len(proposals)} candidates x {ACTIONS} actions, jitter {1e3 * JITTER_M:.1f} mm")
    print(f"admitted {sum(isinstance(r, Admitted) for r in results)} of {len(results)}")
    q = np.stack([checker.ik_chunk(p.actions, ctx.q_cmd)[0] for p in projected])
    openings = np.stack([p.actions for p in projected])[..., GRIPPER]
    paths = Paths(
        q_rad=np.concatenate([np.tile(ctx.q_cmd, (len(q), 1, 1)), q], axis=1),
        opening_m=np.concatenate([np.zeros((len(q), 1)), openings], axis=1),
        held=np.ones((len(q), ACTIONS + 1), dtype=bool),
        scenes=(ctx.scene,) * len(q),
        contact_allowed=np.zeros(len(q), dtype=bool),
        clearance_m=np.zeros(len(q)),
    )
    loop = PlainLoop(checker.collision)
    plain = [any(loop.hits(row) for row in chunk) for chunk in q]
    ours = [hit is not None for hit in checker.collision.check_samples(paths).hits]
    invocations(checker, proposals, ctx, count=asked.invocations)
    straightforwardly(checker, proposals, ctx, count=asked.invocations)
    print(f"same verdicts at the actions: {plain == ours} ({sum(ours)} collide)")
    flat = q.reshape(-1, q.shape[-1])
    figures = {
        "project": median_ms(lambda: checker.project_many(proposals, contexts), 7),
        "check, six layers": median_ms(lambda: checker.check_many(projected, contexts), 7),
        "admit (project + check)": median_ms(lambda: checker.admit_many(proposals, contexts), 7),
        "collision at the actions": median_ms(lambda: checker.collision.check_samples(paths), 7),
        "collision swept": median_ms(lambda: checker.collision.check_swept(paths), 7),
        "one chunk: admit": median_ms(lambda: checker.admit(proposals[-1], context=ctx), 7),
    }
    at_actions = median_ms(lambda: [loop.hits(row) for row in flat], 3)
    way = between(q, ctx.q_cmd)
    swept = median_ms(lambda: [loop.hits(row) for row in way], 1)
    for name, value in figures.items():
        print(f"{name:28s} {value:8.2f} ms")
    print(f"{'plain FCL loop, actions':28s} {at_actions:8.2f} ms")
    print(f"{'plain FCL loop, swept':28s} {swept:8.2f} ms ({len(way)} configurations)")
    print(f"ratio, actions: {at_actions / figures['collision at the actions']:.1f}")
    print(f"ratio, swept:   {swept / figures['collision swept']:.1f}")


if __name__ == "__main__":
    main()
