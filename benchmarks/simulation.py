"""Closed loop against raw physics: how much of a rollout's time is not the simulator's?

Rollouts run in lockstep: an untrained flow network of the configured size is sampled for every
invocation with the configured sampler, and what it answers is replaced by a demonstrated plan, so
that the rollouts last as long as good ones do. Raw physics is a loop of `mj_step` on the same
scene for the same simulated time. Processor time; the parts are timed in a second run, because
timing them costs time itself.

    python -m benchmarks.simulation
"""

import time
from collections import defaultdict
from collections.abc import Iterator, Sequence
from contextlib import ExitStack, contextmanager
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any
from unittest.mock import patch

import mujoco
import numpy as np

from genpolicy.contract.horizons import HorizonConfig
from genpolicy.contract.latency import DECLARED_TERMS, MEASURED_TERMS
from genpolicy.contract.normalisation import MinMax, Normalisation
from genpolicy.evidence.admission_context import make_checker
from genpolicy.evidence.stress import rollout as rollout_module
from genpolicy.evidence.stress import state as state_module
from genpolicy.evidence.stress.latency import DeclaredTerm, LatencyModel
from genpolicy.evidence.stress.matched import step
from genpolicy.evidence.stress.perturbations import Nominal
from genpolicy.evidence.stress.rollout import Rollout
from genpolicy.evidence.stress.state import Outcome, Setup
from genpolicy.execution.cell import ExecutionSettings
from genpolicy.execution.executor import Executor
from genpolicy.feasibility.admission import FeasibilityChecker
from genpolicy.feasibility.settings import FeasibilitySettings
from genpolicy.integrity.documents import read_yaml
from genpolicy.policies.checkpoint import Provenance
from genpolicy.policies.matched_training import PolicySettings
from genpolicy.policies.policy import NetworkPolicy, load_policy
from genpolicy.policies.protocol import Samples
from genpolicy.policies.settings import SamplerConfig
from genpolicy.policies.training import train
from genpolicy.policies.training_request import TrainingRequest
from genpolicy.policies.windows import Windows
from genpolicy.robot.collision import CollisionModel
from genpolicy.robot.kinematics import ArmKinematics
from genpolicy.tasks.api import load_task
from genpolicy.tasks.tabletop_insertion.episodes import demonstrate
from genpolicy.tasks.tabletop_insertion.world import SUB_STEPS, TabletopWorld

PARAMS = read_yaml(Path(__file__).parents[1] / "params.yaml")
HORIZONS = HorizonConfig(**PARAMS["horizons"])
ROLLOUTS, CANDIDATES, TICKS = 16, 4, 240
SAMPLER = SamplerConfig(**PARAMS["train_generators"]["samplers"]["flow"])


class Rehearsed:
    """Samples the network, then answers with the demonstrated plan in its place."""

    stochastic = True

    def __init__(self, network: NetworkPolicy, plans: dict[int, np.ndarray]) -> None:
        self.network, self.plans = network, plans
        self.rollouts: dict[int, Rollout] = {}
        self.memory: dict[int, tuple[int, int, str]] = {}

    def sample(
        self,
        observations: np.ndarray,
        *,
        noise_names: Sequence[Any],
        candidates: int,
        prefix: None = None,  # no rule of joining is asked for here
    ) -> Samples:
        """The network's work, the operator's chunks."""
        drawn = self.network.sample(observations, noise_names=noise_names, candidates=candidates)
        chunks = [self._continue(self.rollouts[name[2]]) for name in noise_names]
        return Samples(np.repeat(np.stack(chunks)[:, None], candidates, axis=1), drawn.nfe)

    def _continue(self, rollout: Rollout) -> np.ndarray:
        """The plan from the last command on; after a rest gently, the skipped row repeated."""
        actions, number = self.plans[rollout.start_index], rollout.start_index
        place, holds, phase = self.memory.get(number, (0, -1, ""))
        near = actions[place : place + 12] - rollout.world.last_action
        place += int(np.argmin(np.linalg.norm(near, axis=1)))
        held = rollout.tally.hold_ticks
        steps = np.ones(HORIZONS.prediction_horizon)
        if holds != held or phase != rollout.world.phase:
            steps[:5] = (0.0, 0.25, 0.5, 0.75, 1.0)
        self.memory[number] = (place, held, rollout.world.phase)
        index = np.minimum(place + np.cumsum(steps), len(actions) - 1)
        low = np.floor(index).astype(int)
        high, share = np.minimum(low + 1, len(actions) - 1), (index - low)[:, None]
        return np.asarray((1 - share) * actions[low] + share * actions[high])


def network(folder: Path) -> NetworkPolicy:
    """A flow policy of the configured size after one training step."""
    settings = PolicySettings(**PARAMS["policy"])
    rng = np.random.default_rng(0)
    windows = Windows(
        rng.normal(size=(64, HORIZONS.observation_horizon, 24)),
        rng.normal(size=(64, HORIZONS.prediction_horizon, 10)),
        np.zeros((64, HORIZONS.prediction_horizon), dtype=bool),
    )
    bounds = {
        name: MinMax(rows.min(axis=(0, 1)), rows.max(axis=(0, 1)))
        for name, rows in (("observation", windows.observations), ("action", windows.actions))
    }
    request = TrainingRequest(
        method="flow", horizons=HORIZONS, normalisation=Normalisation(**bounds),
        network=settings.network, head=settings.head,
        training=settings.training.model_copy(update={"updates": 1}), sampler=SAMPLER,
        provenance=Provenance(
            dataset_manifest_sha256="0" * 64, action_contract_sha256="0" * 64,
            observation_contract_sha256="0" * 64,
        ),
        seed=0,
    )  # fmt: skip
    train(folder, request, windows=windows)
    return load_policy(folder)


class Timer:
    """Processor time and calls by part; nested parts count in both."""

    def __init__(self) -> None:
        self.seconds: dict[str, float] = defaultdict(float)
        self.calls: dict[str, int] = defaultdict(int)

    @contextmanager
    def over(self, parts: dict[str, tuple[Any, str]]) -> Iterator[None]:
        """Time `owner.attribute` for every named part."""
        with ExitStack() as stack:
            for name, (owner, attribute) in parts.items():
                timed = self._timed(name, getattr(owner, attribute))
                stack.enter_context(patch.object(owner, attribute, timed))
            yield

    def _timed(self, name: str, function: Any) -> Any:
        def call(*args: Any, **kwargs: Any) -> Any:
            begin = time.process_time()
            try:
                return function(*args, **kwargs)
            finally:
                self.seconds[name] += time.process_time() - begin
                self.calls[name] += 1

        return call


def closed_loop(policy: Rehearsed, setup: Setup, starts: Sequence[Any]) -> tuple[float, Any]:
    """Processor seconds of all rollouts in lockstep, and the rollouts."""
    epoch = setup.task.calibration_epochs[-1]
    rollouts = [
        Rollout(setup, start, number, calibration_epoch=epoch)
        for number, start in enumerate(starts)
    ]
    policy.rollouts, policy.memory = {r.start_index: r for r in rollouts}, {}
    begin = time.process_time()
    for _ in range(TICKS):
        active = [rollout for rollout in rollouts if not rollout.done]
        if not active:
            break
        step(active, policy, samples=CANDIDATES)  # type: ignore[arg-type]
    seconds = time.process_time() - begin
    for rollout in rollouts:
        rollout.end(Outcome.TIMEOUT)
    return seconds, rollouts


def raw_physics(world: TabletopWorld, ticks: int) -> float:
    """Processor seconds of `mj_step` alone for that many action periods."""
    begin = time.process_time()
    for _ in range(ticks * SUB_STEPS):
        mujoco.mj_step(world.model, world.data)
    return time.process_time() - begin


def main() -> None:
    """Print the figures."""
    task = load_task(PARAMS["task"]["name"])
    specs = task.episode_specs(3, ROLLOUTS, shares={"nominal": 1.0})
    plans = {number: demonstrate(spec).actions for number, spec in enumerate(specs)}
    starts = [spec.start for spec in specs]
    setup = Setup(
        task=task, checker=make_checker(
            task, FeasibilitySettings(**PARAMS["feasibility"]),
            action_period_s=HORIZONS.action_period_s,
        ),
        horizons=HORIZONS, execution=ExecutionSettings(**PARAMS["execution"]),
        latency=LatencyModel(
            {name: DeclaredTerm(0.001, 0.002) for name in DECLARED_TERMS},
            {name: np.full(4, 0.006) for name in MEASURED_TERMS},
            0.0,
        ),
        perturbation="nominal", schedule=Nominal(), root_seed=1,
        method="bench", checkpoint="w", sampler="s",
    )  # fmt: skip
    with TemporaryDirectory() as scratch:
        policy = Rehearsed(network(Path(scratch) / "flow"), plans)
    closed_loop(policy, setup, starts[:2])  # imports, caches
    loop_s, rollouts = closed_loop(policy, setup, starts)
    ticks = sum(rollout.tick for rollout in rollouts)
    simulated_s = ticks * HORIZONS.action_period_s
    world: Any = rollouts[0].world
    raw_s = raw_physics(world, ticks)
    outcomes = sorted(str(rollout.outcome) for rollout in rollouts)
    print(f"{ROLLOUTS} rollouts in lockstep, {CANDIDATES} candidates, {ticks} ticks: ", end="")
    print({name: outcomes.count(name) for name in sorted(set(outcomes))})
    print(f"closed loop  {loop_s:6.2f} s for {simulated_s:.0f} s simulated: ", end="")
    print(f"{simulated_s / loop_s:.0f} x real time, {1e3 * loop_s / ticks:.2f} ms a tick")
    print(f"raw mj_step  {raw_s:6.2f} s: {simulated_s / raw_s:.0f} x real time")
    print(f"ratio {loop_s / raw_s:.2f}")
    profile(policy, setup, starts)


def profile(policy: Rehearsed, setup: Setup, starts: Sequence[Any]) -> None:
    """Where the closed loop's time goes; indented parts are inside the one above."""
    timer = Timer()
    parts: dict[str, tuple[Any, str]] = {
        "world.advance": (TabletopWorld, "advance"),
        "feasibility admit": (FeasibilityChecker, "admit_many"),
        "  inverse kinematics": (ArmKinematics, "solve"),
        "  collision, actions": (CollisionModel, "check_samples"),
        "  collision, swept": (CollisionModel, "check_swept"),
        "boundary and context": (rollout_module, "context_of"),
        "network sample": (NetworkPolicy, "sample"),
        "executor tick": (Executor, "tick"),
        "executor observe": (Executor, "observe"),
        "latency draws": (state_module, "draw_latency"),
        "observation": (TabletopWorld, "observe"),
    }
    with timer.over(parts):
        total_s, _ = closed_loop(policy, setup, starts)
    print(f"\n{'part (timed run, nested parts count twice)':44s} {'share':>6s} {'ms':>8s} calls")
    for name in parts:
        seconds = timer.seconds[name]
        print(f"{name:44s} {seconds / total_s:6.1%} {1e3 * seconds:8.1f} {timer.calls[name]}")
    outer = [name for name in parts if not name.startswith("  ")]
    rest_s = total_s - sum(timer.seconds[name] for name in outer)
    print(f"{'rest':44s} {rest_s / total_s:6.1%} {1e3 * rest_s:8.1f}")


if __name__ == "__main__":
    main()
