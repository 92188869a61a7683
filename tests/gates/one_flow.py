"""A flow that was trained in a second, and rollouts of it, for tests of what is drawn again."""

from pathlib import Path

import numpy as np
import yaml

from genpolicy.candidates.joining import JoiningSettings
from genpolicy.candidates.judged import JudgedPolicy
from genpolicy.candidates.planned import planned
from genpolicy.contract.horizons import HorizonConfig
from genpolicy.contract.normalisation import MinMax, Normalisation
from genpolicy.evidence.stress.latency import (
    DECLARED_TERMS,
    MEASURED_TERMS,
    DeclaredTerm,
    LatencyModel,
)
from genpolicy.evidence.stress.matched import matched_starts, run_shard
from genpolicy.evidence.stress.perturbations import Nominal, ReducedEnvelope
from genpolicy.evidence.stress.shard import Comparison, Shard
from genpolicy.execution.cell import Cell, ExecutionSettings
from genpolicy.execution.journal import Journal, read_journal, write_journal
from genpolicy.feasibility.settings import FeasibilitySettings
from genpolicy.policies.checkpoint import Provenance
from genpolicy.policies.settings import HeadConfig, NetworkConfig, SamplerConfig, TrainingConfig
from genpolicy.policies.training import train
from genpolicy.policies.training_request import TrainingRequest
from genpolicy.policies.windows import Windows
from genpolicy.seeds import stream
from genpolicy.tasks.api import WorldSettings, load_task

PARAMS = yaml.safe_load((Path(__file__).parents[2] / "params.yaml").read_text())
PARAMS["seed"] = 20261125  # its own: chunks meet in these rollouts, whatever the default plan draws
HORIZONS = HorizonConfig(**PARAMS["horizons"])
TASK = load_task("tabletop_insertion")
STARTS = matched_starts(TASK, root_seed=PARAMS["seed"], count=4)
SAMPLES = 2


def train_flow(folder, *, seed, sampler=None):
    """A flow that barely moves from where it is, to either side."""
    rng = stream(2, "windows")
    worlds = [TASK.make_world(s, settings=WorldSettings(TASK.calibration_epochs[-1]))
              for s in STARTS]  # fmt: skip
    seen = np.repeat(np.stack([world.observe() for world in worlds]), 30, axis=0)
    observations = np.repeat(seen[:, None], 2, axis=1) + rng.normal(0, 1e-3, (120, 2, 24))
    actions = np.repeat(np.stack([world.last_action for world in worlds]), 30, axis=0)
    actions = np.repeat(actions[:, None], 16, axis=1)
    actions[:, :, 1] += np.linspace(0, 0.02, 16) * rng.choice([-1.0, 1.0], 120)[:, None]
    ends = {
        name: MinMax(rows.min(axis=(0, 1)), rows.max(axis=(0, 1)))
        for name, rows in (("observation", observations), ("action", actions))
    }
    request = TrainingRequest(
        method="flow", horizons=HORIZONS, normalisation=Normalisation(**ends),
        network=NetworkConfig(
            encoder_width=16, condition_dim=16, trunk_width=48, trunk_blocks=1, time_features=16,
            head_parameters=40_000,
        ),
        head=HeadConfig(posterior_width=16),
        training=TrainingConfig(updates=60, batch_size=64, learning_rate=3e-3, warmup_updates=5),
        sampler=sampler or SamplerConfig(name="euler", steps=2),
        provenance=Provenance(
            dataset_manifest_sha256="a" * 64, action_contract_sha256="b" * 64,
            observation_contract_sha256="c" * 64,
        ),
        seed=seed,
    )  # fmt: skip
    return train(folder, request, windows=Windows(observations, actions, np.zeros((120, 16), bool)))


def folder_of(root):
    return root / "artifacts" / "train_generators" / "flow" / "seed_0"


def roll_out(path, checkpoint, **more):
    """The journal of a shard of rollouts, as `rolled_out`."""
    rolled_out(path, checkpoint, **more)
    return path


def rolled_out(path, checkpoint, *, joining=None, starts=4, **execution):
    """A shard of rollouts under slower commands than the policy would give; some are refused."""
    folder, sha256 = checkpoint
    comparison = Comparison(
        task=TASK.name, starts=tuple(start.to_json() for start in STARTS[:starts]),
        episode_limit_s=1.0, samples=SAMPLES,
        cell=Cell(HORIZONS, ExecutionSettings(**(PARAMS["execution"] | execution))),
        feasibility=FeasibilitySettings(
            **(PARAMS["feasibility"] | {"position_change_limit_m": 0.006})
        ),
        root_seed=PARAMS["seed"], joining=joining or JoiningSettings(),
    )  # fmt: skip
    slow = ReducedEnvelope(
        **(PARAMS["stress"]["perturbations"]["envelope"] | {"speed_limit_m_s": 0.008})
    )
    times = LatencyModel(
        {name: DeclaredTerm(0.001, 0.002) for name in DECLARED_TERMS},
        {name: np.full(8, 0.004) for name in MEASURED_TERMS}, 0.0,
    )  # fmt: skip
    judged = JudgedPolicy("flow", 0, folder, sha256, "cpu")
    return run_shard(Shard(comparison, judged, times, "envelope", slow, path))


def roll_out_planned(path):
    """A shard of a second of rollouts of the task's planner."""
    comparison = Comparison(
        task=TASK.name, starts=tuple(start.to_json() for start in STARTS[:2]),
        episode_limit_s=1.0, samples=SAMPLES,
        cell=Cell(HORIZONS, ExecutionSettings(**PARAMS["execution"])),
        feasibility=FeasibilitySettings(**PARAMS["feasibility"]), root_seed=PARAMS["seed"],
    )  # fmt: skip
    times = LatencyModel(
        {name: DeclaredTerm(0.001, 0.002) for name in DECLARED_TERMS},
        {name: np.full(8, 0.004) for name in MEASURED_TERMS}, 0.0,
    )  # fmt: skip
    run_shard(Shard(comparison, planned(TASK.name, HORIZONS, seed=0), times, "nominal", Nominal(),
                    path))  # fmt: skip
    return path


def edited(path, target, change):
    """The journal with some events changed; None leaves one out."""
    sessions = []
    for name, events in read_journal(path).items():
        journal = Journal(name)
        for event in events:
            payload = change(event.kind, dict(event.payload))
            if payload is not None:
                journal.add(event.kind, event.t, payload)
        sessions.append(journal)
    target.parent.mkdir(exist_ok=True)
    write_journal(target, sessions)
    return target
