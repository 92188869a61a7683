"""Warm start against cold: what does starting from the plan before save, and what does it cost?

The same trained flow and diffusion drive the same starts in closed loop, once from noise alone
(`strength` 1) and then with fewer steps from what is left of the plan before
(`stress.joining: {rule: warm_start, strength: ...}`). Every chunk is projected and judged as in a
run of the ladder; drawn latencies are equal for all, so that only what is drawn differs. What a
sample takes is measured beside the loop.

    python -m benchmarks.warm_start --artifacts artifacts --starts 12
"""

import argparse
import time
from collections.abc import Sequence
from dataclasses import dataclass, field
from itertools import pairwise
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from genpolicy.candidates.answering import AnsweringPolicy
from genpolicy.candidates.joining import JoiningSettings
from genpolicy.candidates.judged import JudgedPolicy, trained
from genpolicy.contract.horizons import HorizonConfig
from genpolicy.contract.latency import DECLARED_TERMS, MEASURED_TERMS
from genpolicy.evidence.admission_context import make_checker
from genpolicy.evidence.stress.latency import DeclaredTerm, LatencyModel
from genpolicy.evidence.stress.matched import matched_starts, step
from genpolicy.evidence.stress.perturbations import Nominal
from genpolicy.evidence.stress.rollout import Rollout
from genpolicy.evidence.stress.state import Outcome, Setup
from genpolicy.execution.cell import ExecutionSettings
from genpolicy.feasibility.settings import FeasibilitySettings
from genpolicy.integrity.documents import read_yaml
from genpolicy.policies.policy import NetworkPolicy
from genpolicy.policies.prefix import Prefix
from genpolicy.policies.protocol import NoiseName, Samples
from genpolicy.tasks.api import Task, load_task

Array = NDArray[np.float64]

PARAMS = read_yaml(Path(__file__).parents[1] / "params.yaml")
HORIZONS = HorizonConfig(**PARAMS["horizons"])
METHODS = ("flow", "diffusion")
CANDIDATES, REPEATS = 4, 40
ANSWERED_S = 0.006
"""Drawn for each measured term of an answer, of every strength alike, s."""
COLUMNS = (
    "NFE", "sample ms", "jump mm", "p95", "jerk m/s3", "p95", "modes switch", "admissible",
    "success",
)  # fmt: skip


@dataclass
class Spied(AnsweringPolicy):
    """A policy whose invocations are kept as they come, one observation each.

    Attributes:
        policy: Whose samples they are.
        seen: Newest observation and first candidate of each invocation, by rollout.
    """

    policy: NetworkPolicy
    seen: dict[NoiseName, list[tuple[Array, Array]]] = field(default_factory=dict)

    def __post_init__(self) -> None:
        super().__init__(self.policy)

    def sample(
        self, observations: Array, *, noise_names: Sequence[NoiseName], candidates: int,
        prefix: Prefix | None = None,
    ) -> Samples:  # fmt: skip
        """As `NetworkPolicy.sample`."""
        drawn = super().sample(
            observations, noise_names=noise_names, candidates=candidates, prefix=prefix
        )
        for name, row, chunks in zip(noise_names, observations, drawn.actions, strict=True):
            self.seen.setdefault(name[:-1], []).append((row[-1], chunks[0]))
        return drawn


def setup_of(judged: JudgedPolicy, task: Task, joining: JoiningSettings) -> Setup:
    """The nominal condition, with the settings of `params.yaml`."""
    policy = judged.load()
    feasibility = FeasibilitySettings(**PARAMS["feasibility"])
    return Setup(
        task=task,
        checker=make_checker(task, feasibility, action_period_s=HORIZONS.action_period_s),
        horizons=HORIZONS, execution=ExecutionSettings(**PARAMS["execution"]),
        latency=LatencyModel(
            {name: DeclaredTerm(0.001, 0.002) for name in DECLARED_TERMS},
            {name: np.full(4, ANSWERED_S) for name in MEASURED_TERMS}, 0.0,
        ),
        perturbation="nominal", schedule=Nominal(), root_seed=PARAMS["seed"],
        method=judged.name, checkpoint=policy.checkpoint_hash,
        sampler=joining.sampler_hash(policy.sampler_config_hash), joining=joining,
    )  # fmt: skip


def closed_loop(policy: Spied, setup: Setup, *, starts: int, ticks: int) -> list[Rollout]:
    """All rollouts, in lockstep to their ends."""
    epoch = setup.task.calibration_epochs[-1]
    drawn = matched_starts(setup.task, root_seed=PARAMS["seed"], count=starts)
    rollouts = [
        Rollout(setup, start, number, calibration_epoch=epoch) for number, start in enumerate(drawn)
    ]
    for _ in range(ticks):
        if active := [rollout for rollout in rollouts if not rollout.done]:
            step(active, policy, samples=CANDIDATES)
    for rollout in rollouts:
        rollout.end(Outcome.TIMEOUT)
    return rollouts


def sampled(policy: NetworkPolicy, strength: float, repeats: int) -> tuple[int, float]:
    """Counted evaluations of a warm invocation, and what its median one takes, ms."""
    sizes = policy.checkpoint.config.dimensions
    observation = np.zeros((1, sizes.observation_horizon, sizes.observation_dim))
    rows = sizes.prediction_horizon
    still = np.zeros((1, rows, sizes.action_dim))
    prefix = Prefix(still, np.ones((1, rows)), 1.0, strength)
    took = []
    for repeat in range(repeats + 3):
        begun = time.perf_counter()
        drawn = policy.sample(
            observation, noise_names=[("took", repeat)], candidates=CANDIDATES, prefix=prefix
        )
        took.append(1e3 * (time.perf_counter() - begun))
    return drawn.nfe, float(np.median(took[3:]))


def switched(policy: Spied, task: Task) -> tuple[int, int]:
    """Successive chunks of one rollout that name different modes, and how many name one each."""
    changes, pairs = 0, 0
    for invocations in policy.seen.values():
        modes = [task.mode_of(chunk[:, :3], seen) for seen, chunk in invocations]
        for before, after in pairwise(modes):
            if "unassigned" not in {before, after}:
                pairs, changes = pairs + 1, changes + (before != after)
    return changes, pairs


def row_of(judged: JudgedPolicy, strength: float, given: argparse.Namespace) -> list[str]:
    """The figures of one method at one strength, in the order of `COLUMNS`."""
    task = load_task(PARAMS["task"]["name"])
    joining = JoiningSettings(rule="warm_start", strength=strength)
    policy = Spied(judged.load())
    rollouts = closed_loop(
        policy, setup_of(judged, task, joining), starts=given.starts, ticks=given.ticks
    )
    # The first chunk of a rollout has nothing to join under either start.
    splices = [one for rollout in rollouts for one in rollout.splices if one.parents]
    jumps_mm = [1e3 * one.raw_jump_m for one in splices]
    jerks = [one.raw_jerk_m_s3 for one in splices if one.raw_jerk_m_s3 is not None]
    events = [event for rollout in rollouts for event in rollout.journal.events()]
    judged_ones = [event.payload for event in events if event.kind == "candidate"]
    passed = [all(own is True for own in one["layers"].values()) for one in judged_ones]
    nfe, took_ms = sampled(policy.policy, strength, given.repeats)
    changes, pairs = switched(policy, task)
    successes = sum(rollout.outcome is Outcome.SUCCESS for rollout in rollouts)
    return [
        f"{nfe}", f"{took_ms:.2f}", *_middle_and_p95(jumps_mm), *_middle_and_p95(jerks),
        f"{changes}/{pairs}", f"{sum(passed)}/{len(passed)}",
        f"{successes}/{len(rollouts)}",
    ]  # fmt: skip


def _middle_and_p95(values: Sequence[float]) -> list[str]:
    if not values:
        return ["-", "-"]
    return [f"{np.quantile(values, level):.3g}" for level in (0.5, 0.95)]


def main(arguments: Sequence[str] | None = None) -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(prog="python -m benchmarks.warm_start")
    parser.add_argument("--artifacts", type=Path, default=Path("artifacts"))
    parser.add_argument("--starts", type=int, default=12)
    parser.add_argument("--ticks", type=int, default=240, help="of each rollout, at most")
    parser.add_argument("--repeats", type=int, default=REPEATS)
    parser.add_argument("--strengths", type=float, nargs="+", default=[1.0, 0.75, 0.5, 0.25])
    given = parser.parse_args(arguments)
    print(f"{'':18s}" + "".join(f"{name:>13s}" for name in COLUMNS))
    everybody = trained(given.artifacts / "train_generators", METHODS, seeds=[0], device="cpu")
    for judged in everybody:
        for strength in given.strengths:
            figures = row_of(judged, strength, given)
            name = f"{judged.name} {strength:g}" + (" (cold)" if strength == 1.0 else "")
            print(f"{name:18s}" + "".join(f"{own:>13s}" for own in figures), flush=True)


if __name__ == "__main__":
    main()
