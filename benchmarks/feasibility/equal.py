"""Are the compiled answers those of the straightforward way? Both, of the same random questions.

    python -m benchmarks.feasibility.equal [--configurations 100000] [--chunks 6250] [--seed 0]

Configurations are drawn within the joint ranges, half of them about a pose above the table; the
straightforward way is numpy of `genpolicy.robot` for kinematics, torques and sphere bounds, each
configuration's pose solved from a seed nearby, and every pair of shapes asked of FCL one by one.
Chunks (16 rows each) are drawn by `tests/feasibility/dense.py`, from easy to refused. The exit
code is 1 where a verdict or a reason differs, or a figure by more than its tolerance. Not compared
are joints of a pose that inverse kinematics does not reach in either way: both refuse it as
unreachable, and where 40 steps of a solver that finds nothing end is a matter of rounding.
"""

import argparse
import math
import runpy
import sys
from pathlib import Path

import numpy as np

from benchmarks.feasibility.__main__ import PERIOD_S, PlainLoop
from benchmarks.feasibility.plain import PlainChecker, plain_cell
from genpolicy.feasibility.admission import FeasibilityChecker
from genpolicy.feasibility.cell import Cell, cell_of
from genpolicy.feasibility.settings import FeasibilitySettings
from genpolicy.robot.collision import Paths
from genpolicy.robot.scene_state import SceneState
from genpolicy.tasks.api import load_task

TOGETHER = 1000
ABOVE_TABLE = np.array([0.0, -0.3, 0.0, -2.2, 0.0, 1.9, 0.785])
SPREAD_RAD, NEAR_RAD, OPENING_M = 0.35, 0.05, 0.01
TOLERANCES = {
    "frames, m or 1": 1e-12,
    "sphere bounds, m": 1e-12,
    "torque, N m": 1e-9,
    "condition, relative": 1e-6,
    "joints of a reached pose, rad": 1e-7,
}
MARGIN = 1e-6  # of 1 + the margin in its unit
# FCL finds a depth by iteration: poses that differ in the last bit get depths 0.1 mm apart.
HIT = "depth of a hit, as FCL says it, m"
TOLERANCES |= {HIT: 5e-4}
UNREACHED = ("joint_position", "singular", "unreachable", "branch_jump")
DENSE = Path(__file__).parents[2] / "tests" / "feasibility" / "dense.py"


def configurations(rng: np.random.Generator, cell: Cell, count: int) -> np.ndarray:
    """Random joint positions. Shape (count, J)."""
    lower, upper = cell.kinematics.lower_rad, cell.kinematics.upper_rad
    anywhere = rng.uniform(lower, upper, (count, len(lower)))
    near = np.clip(ABOVE_TABLE + rng.normal(0, SPREAD_RAD, anywhere.shape), lower, upper)
    return np.where(np.arange(count)[:, None] % 2, near, anywhere)


def posed(q: np.ndarray) -> Paths:
    """Each configuration as a path that stands."""
    count = len(q)
    return Paths(
        q_rad=np.stack([q, q], axis=1),
        opening_m=np.full((count, 2), OPENING_M),
        held=np.ones((count, 2), dtype=bool),
        scenes=(SceneState(),) * count,
        contact_allowed=np.zeros(count, dtype=bool),
        clearance_m=np.zeros(count),
    )


class Tally:
    """What differs, and the largest difference of each figure."""

    def __init__(self) -> None:
        self.asked: dict[str, int] = {}
        self.differ: dict[str, int] = {}
        self.worst: dict[str, float] = {}

    def same(self, name: str, first: object, second: object) -> None:
        """Count answers, and those that are not the same."""
        equal = np.atleast_1d(np.equal(np.array(first), np.array(second)))
        self.asked[name] = self.asked.get(name, 0) + equal.size
        self.differ[name] = self.differ.get(name, 0) + int(np.sum(~equal))

    def close(self, name: str, first: np.ndarray, second: np.ndarray) -> None:
        """Keep the largest difference; NaN on one side only is infinite."""
        first, second = np.asarray(first), np.asarray(second)
        both = (np.isnan(first) & np.isnan(second)) | (first == second)
        with np.errstate(invalid="ignore"):
            off = np.where(both, 0.0, np.nan_to_num(np.abs(first - second), nan=math.inf))
        self.worst[name] = max(self.worst.get(name, 0.0), float(np.max(off, initial=0.0)))


def ask_configurations(cell: Cell, rng: np.random.Generator, count: int, tally: Tally) -> None:
    """Kinematics, torques, bounds and collision of random configurations, both ways."""
    plain = plain_cell(cell)
    loop = PlainLoop(plain.collision)
    poses = cell.collision.poses((SceneState(),) * TOGETHER)
    for begin in range(0, count, TOGETHER):
        q = configurations(rng, cell, min(TOGETHER, count - begin))
        rates = rng.normal(0, 1, (2, *q.shape))
        ours, theirs = cell.kinematics.frames(q), plain.kinematics.frames(q)
        tally.close("frames, m or 1", ours.rotation, theirs.rotation)
        tally.close("frames, m or 1", ours.position_m, theirs.position_m)
        opening = np.full(len(q), OPENING_M)
        bounds = [
            c.collision.broad.lower_bounds(c.collision.broad.centres(f, opening), poses[: len(q)])
            for c, f in ((cell, ours), (plain, theirs))
        ]
        tally.close("sphere bounds, m", *bounds)
        for name in ("dynamics", "loaded_dynamics"):
            pair = [getattr(c, name).torque(q, *rates) for c in (cell, plain)]
            tally.close("torque, N m", *pair)
        conditions = [c.kinematics.condition_number(q) for c in (cell, plain)]
        tally.close("condition, relative", conditions[0] / conditions[1], np.ones(len(q)))
        seeds = q + rng.normal(0, NEAR_RAD, q.shape)
        target = theirs.position_m[:, -1], theirs.rotation[:, -1]
        found = [c.kinematics.solve(*target, q_seed_rad=seeds) for c in (cell, plain)]
        tally.same("pose reached", found[0].converged, found[1].converged)
        both = found[0].converged & found[1].converged
        name = "joints of a reached pose, rad"
        tally.close(name, found[0].q_rad[both], found[1].q_rad[both])
        hits = [hit is not None for hit in cell.collision.check_samples(posed(q)).hits]
        tally.same("touches, by FCL of every pair", hits, [loop.hits(row) for row in q])


def ask_chunks(cell: Cell, seed: int, count: int, tally: Tally) -> None:
    """Verdict, reason and margins of random chunks, both ways."""
    draw = runpy.run_path(str(DENSE), run_name="dense")
    rng = np.random.default_rng(seed)
    ours, theirs = FeasibilityChecker(cell), PlainChecker(cell)
    asked = 0
    while asked < count:
        families = [draw["drawn"](rng, cell) for _ in range(64)]
        shares = rng.uniform(0, 2, len(families))
        found = list(draw["asked"](theirs, families, shares).values())[: count - asked]
        asked += len(found)
        proposals, contexts = map(list, zip(*found, strict=True))
        answers = []
        for checker in (ours, theirs):
            projected = checker.project_many(proposals, contexts)
            answers.append((projected, checker.check_many(projected, contexts)))
        tally_chunks(answers, tally)


def tally_chunks(answers: list[tuple[list, list]], tally: Tally) -> None:
    """Compare two lists of projected chunks and verdicts."""
    (chunks, verdicts), (plain_chunks, plain_verdicts) = answers
    for chunk, verdict, other, plain in zip(
        chunks, verdicts, plain_chunks, plain_verdicts, strict=True
    ):
        tally.same("chunk passes", verdict.passed, plain.passed)
        tally.same("first reason", verdict.first_reason, plain.first_reason)
        tally.same("reason of each layer", [v.reason for v in verdict.layers],
                   [v.reason for v in plain.layers])  # fmt: skip
        tally.same("checks that were evaluated", sorted(verdict.margins) == sorted(plain.margins),
                   True)  # fmt: skip
        tally.close("projected actions", chunk.actions, other.actions)
        # The last iterate of a pose that is not reached depends on the last bit of the first.
        lost = () if plain.margins.get("unreachable", 0.0) >= 0 else UNREACHED
        for name in sorted(set(verdict.margins) & set(plain.margins) - set(lost)):
            ours, theirs = verdict.margins[name], plain.margins[name]
            if name.endswith("_collision") or name == "contact_surface":
                tally.same("collision or none", ours >= 0, theirs >= 0)
                if theirs < 0:
                    tally.close(HIT, np.array(ours), np.array(theirs))
                    continue
            scale = 1.0 if not math.isfinite(theirs) else 1.0 + abs(theirs)
            tally.close(f"margin {name}", np.array(ours / scale), np.array(theirs / scale))


def main() -> int:
    """Command line; 1 where something differs."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--configurations", type=int, default=100_000)
    parser.add_argument("--chunks", type=int, default=6_250)
    parser.add_argument("--seed", type=int, default=0)
    args = parser.parse_args()
    settings = FeasibilitySettings(position_change_limit_m=0.05)
    cell = cell_of(load_task("tabletop_insertion"), settings, action_period_s=PERIOD_S)
    tally = Tally()
    ask_configurations(cell, np.random.default_rng(args.seed), args.configurations, tally)
    ask_chunks(cell, args.seed, args.chunks, tally)
    wrong = [name for name, count in tally.differ.items() if count]
    for name, count in tally.asked.items():
        print(f"{name:36s} {count:9d} asked, {tally.differ[name]} differ")
    for name, worst in tally.worst.items():
        limit = TOLERANCES.get(name, MARGIN)
        print(f"{name:36s} largest difference {worst:.2g}, tolerated {limit:.0e}")
        wrong += [name] * (not worst <= limit)
    print(f"outside: {', '.join(wrong) or 'nothing'}")
    return 1 if wrong else 0


if __name__ == "__main__":
    sys.exit(main())
