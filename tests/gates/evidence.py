"""Small synthetic evidence on which every gate passes, and the settings that judge it."""

import base64
import contextlib
import copy
import functools
import hashlib
import json
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import pyarrow as pa
import watched
import yaml
from layered import as_the_layers_say, said_of
from ticked import as_it_ticked
from watched import write_watched

from gates import pipeline
from gates.asked_for import REFUSED_FOR
from gates.cause import default_limits
from gates.cause.limits import OWN
from gates.feasibility.settings import LAYERS
from gates.preregistration import PREREGISTRATION, plan_bytes
from gates.report import folder_of
from gates.reproducibility.fixtures import TrainedFixture
from gates.reproducibility.modelled import quantiles_of, uniforms
from gates.reproducibility.timing import MEASURED_HERE, TERMS
from genpolicy.audit.component_rows import ComponentModes, Tremor
from genpolicy.audit.reach_rows import Alternative, FindingDraw, Reach, Side, StructureDraw
from genpolicy.audit.rows import (
    Asked,
    Calibration,
    Clock,
    Demonstration,
    Finding,
    ModeOutcome,
    Prediction,
    RecoveryOutcome,
    ReplayRow,
    Resample,
    SituationRow,
    Stratum,
)
from genpolicy.audit.shown_rows import Alignment, ExampleChunk
from genpolicy.candidates.votes import VOTE_CHECKS
from genpolicy.contract.action import ACTION_COMPONENTS
from genpolicy.data.rows import EpisodeRow, FrameRow
from genpolicy.evidence.rows.brought import AFTER, BEFORE, AnswerRow, FixtureAgainRow
from genpolicy.evidence.rows.clocks import ClockAgeRow, ClockInvocationRow, ClockTickRow
from genpolicy.evidence.rows.need import (
    EffectRow,
    FactorErrorRow,
    FactorModeRow,
    ModeRow,
    OfflineRow,
)
from genpolicy.evidence.rows.reproducibility import (
    VARIATIONS,
    CandidatesRow,
    ComputeRow,
    CoverageRow,
    DensityRow,
    LatencyModelRow,
    LatencyRow,
    MachineRow,
    NfeRow,
    SampleRow,
    SweepLatencyRow,
    VariationRow,
)
from genpolicy.evidence.rows.shadow import (
    CandidateRow,
    ShadowCountRow,
    ShadowHoldRow,
    ShadowStubRow,
)
from genpolicy.evidence.rows.stress import (
    ConservationRow,
    InvocationRow,
    OverrunRow,
    RecoveryRow,
    RolloutRow,
    SpliceRow,
    StressCountRow,
    StressStubRow,
)
from genpolicy.evidence.shadow.clauses import CLAUSES
from genpolicy.evidence.shadow.continuity_mutants import CLAUSES as OF_CONTINUITY
from genpolicy.evidence.shadow.continuity_mutants import ROW
from genpolicy.evidence.shadow.on_the_way import INCIDENTS as ON_THE_WAY
from genpolicy.evidence.shadow.place_mutants import pairs
from genpolicy.evidence.shadow.stop_mutants import DEAF
from genpolicy.evidence.split import split_sha256
from genpolicy.execution.checks import CHECKS as EXECUTION_CHECKS
from genpolicy.feasibility.checks import CHECKS as FEASIBILITY_CHECKS
from genpolicy.integrity.documents import canonical_json
from genpolicy.integrity.rows import write_rows
from genpolicy.integrity.tables import read_table, write_table
from genpolicy.policies.settings import HeadConfig, NetworkConfig, SamplerConfig, TrainingConfig
from genpolicy.policies.validation_row import ValidationRow

CODE = "genpolicy/robot/impedance.py"
"""A file of code in the repository of the tests."""
CHECKS = (
    *((check.layer, check.name) for check in FEASIBILITY_CHECKS),
    *(("execution", check.name) for check in EXECUTION_CHECKS),
    *(("execution", f"vote_{check.name}") for check in VOTE_CHECKS),
    *(("execution", f"deaf_to_{name}") for name in DEAF),
    *(("execution", f"{name}@{place}") for name, place in pairs()),
    *(("execution", name) for name in CLAUSES),
    *(("execution", f"{ROW}:{name}") for name in OF_CONTINUITY),
)

BASELINES = ("bc", "chunked_bc", "act")
REMEDIES = {"chunked_l1": "direct", "one_mode_bc": "direct", "bc_noise": "offset"}
DRAWN = "ibc"
COMPARED = (*BASELINES, *REMEDIES)
"""Baselines that the candidates are compared with, and timed beside."""
CANDIDATES = ("diffusion", "flow")
CONDITIONS = (
    "nominal", "camera_delay", "compute_contention", "network_jitter", "queue_reorder",
    "recovery_drill", "envelope",
)  # fmt: skip
STARTS = 80
INVOCATIONS = 20
OF_BROUGHT = {"B": {"conformance"}, "C": {"changed_answers"}, "D": {"changed_answers"}}
"""Criteria that are asked of those only who were brought; nobody is, here."""
UPDATES = 4000
PARAMETERS = 100
SPLIT = {"split": {"rule": "episodes", "sha256": "5" * 64}}
SAMPLER, STEPS = "euler", 8
"""Of the candidates; one evaluation a step."""
PNG = base64.b64decode(
    "iVBORw0KGgoAAAANSUhEUgAAAAEAAAABCAAAAAA6fptVAAAACklEQVR4nGNgAAAAAgABSK+kcQAAAABJRU5ErkJggg=="
)
"""The smallest grey picture: one pixel."""
ENVELOPE = {
    "condition": "envelope",
    "workspace_lower_m": [0.35, -0.2, 0.03],
    "workspace_upper_m": [0.7, 0.2, 0.25],
    "speed_limit_m_s": 0.25,
    "reached": {
        method: {
            "commands": 400,
            "fastest_m_s": 0.25,
            "lowest_m": [0.36, -0.18, 0.03],
            "highest_m": [0.69, 0.2, 0.25],
        }
        for method in CANDIDATES
    },
}
TASK = {
    "name": "tabletop_insertion",
    "entry_point": "",
    "distribution": {"name": "", "version": ""},
    "package": {},
    "scene": {},
    **dict.fromkeys(("scene_sha256", "observation_sha256", "action_sha256"), "0" * 64),
    "phases": {"all": ["approach"]},
    "obstacles": ["post"],
    "workspace_m": [[0.3, -0.22, 0.02], [0.72, 0.22, 0.28]],
    "robot": "panda",
    **dict.fromkeys(("robot_sha256", "sha256"), "0" * 64),
}
SPEED = {
    "diffusion": 0.02, "flow": 0.01, "bc": 0.004, "chunked_bc": 0.005, "act": 0.006,
    "chunked_l1": 0.005, "one_mode_bc": 0.005, "bc_noise": 0.006,
}  # fmt: skip


FIXTURES = (
    "held_out",
    "two_modes",
    "stale_observation",
    "infeasible_rotation",
    "collision",
    "phase_change",
    "reordered_chunk",
)


PLAYED = tuple(name for name in FIXTURES if name != "two_modes")
INCIDENTS = [
    (item.name, str(item.reason), item.arrives > 1 or item.overtaken or item.hangs)
    for item in ON_THE_WAY
]
"""What befalls twelve chunks of each candidate, its reason, and whether another one is executed."""


def by_owner(**limits: tuple[Any, str]) -> dict[str, dict[str, list[Any]]]:
    """Limits as `params.yaml` holds them, from criterion and (limit, owner)."""
    found: dict[str, dict[str, list[Any]]] = {}
    for name, (limit, owner) in limits.items():
        found.setdefault(owner, {})[name] = [limit, "test"]
    return found


def _cause() -> dict[str, Any]:
    """The packaged limits of the questions that only the cause asks."""
    return {
        owner: {name: value for name, value in questions.items() if name in OWN}
        for owner, questions in default_limits().as_json().items()
    }


VARIANTS = {
    "reference": ("reference", "direct", 16, []),
    "linear_encoder": ("representation", "direct", 16, ["network.encoder"]),
    "transformer": ("trunk", "direct", 16, ["network.trunk"]),
    "energy_head": ("head", "derivative_free", 16, ["method", "sampler.name"]),
    "single_action": ("temporal", "direct", 1, ["method"]),
}
DECLARED = {
    term: [0.0005 * (term == "network"), 0.002] for term in TERMS if term not in MEASURED_HERE
}
"""Least and most of the terms that nobody can measure here, s."""
PARAMS: dict[str, Any] = {
    "seed": 1,
    "compute": {"device": "cpu"},
    "confidence": 0.95,
    "comparison": {"may_differ": [["head", "what is compared"]]},
    "horizons": {"execution_horizon": 8, "action_period_s": 0.05},
    "policy": {"seeds": [0], "fixtures": 8},
    "reload": {"samples": 16},
    "latency": {"warm": 8, "cold": 8, "declared": DECLARED},
    "execution": {
        "deadline_s": 0.15,
        "replan_lead_rows": 3,
        "maximum_age_s": 0.45,
        "term_deadlines": [
            ["exposure", 0.05, "drop_observation"],
            ["capture", 0.15, "drop_observation"],
            ["decode", 0.05, "skip_invocation"],
            ["transfer", 0.05, "skip_invocation"],
            ["preprocess", 0.05, "skip_invocation"],
            ["encode", 0.05, "cancel_candidate"],
            ["sample", 0.15, "cancel_candidate"],
            ["select", 0.05, "continue"],
            ["project", 0.1, "reject_candidate"],
            ["network", 0.25, "reject_stale"],
            ["queue", 0.25, "reject_stale"],
        ],
    },
    "task": {"name": "tabletop_insertion"},
    "train_baselines": {"samplers": {name: {} for name in (*BASELINES, *REMEDIES, DRAWN)}},
    "measure_baselines": {
        "samples": 16,
        "latent": {"method": "act", "convention": "z_prior", "permutations": 999},
    },
    "train_factors": {"variants": {name: {} for name in VARIANTS}},
    "train_generators": {"samplers": {name: {} for name in CANDIDATES}},
    "candidates": {},
    "monitors": watched.SECTION,
    "stress": {
        "starts": STARTS,
        "baselines": list(COMPARED),
        "perturbations": {name: {} for name in CONDITIONS},
        "margin": 0.1,
        "alpha": 0.1,
        "samples": 4,
        "planned_effect": [0.5, 0.95],
        "episode_limit_s": 12.0,
    },
    "gate_a": {
        "cause": _cause(),
        "held_out_splits": ["validation", "test"],
        "deployed_conventions": ["direct", "z_zero", "offset"],
        "generative_baselines": [DRAWN],
        "chunked_baseline": "chunked_bc",
        "limits": by_owner(
            refused_recordings_accounted=(0, "perception"),
            unasked_checks=(0, "perception"),
            clock_residual_s=(0.01, "perception"),
            lag_spread_rows=(1, "controller"),
            calibration_residual_m=(0.005, "perception"),
            label_disagreement=(0.2, "model"),
            held_out_situations=(20, "model"),
            multimodal_situations=(10, "model"),
            persistence_margin=(0.05, "model"),
            mode_success_lower=(0.6, "model"),
            mode_feasible_share=(0.9, "controller"),
            mean_defeated_share=(0.5, "model"),
            remedy_valid_share=(0.5, "model"),
            data_defects=(0, "perception"),
            strata_effect=(0.3, "perception"),
            told_share=(0.4, "perception"),
            cause_accepted=(1, "model"),
            baselines_matched=(0, "model"),
            baseline_mode_coverage=(0.6, "model"),
            phase_collapse_share=(0.5, "perception"),
            chunking_valid_share=(0.5, "model"),
            latent_dependence_p=(0.05, "model"),
            factors_isolated=(0, "model"),
            factor_valid_share=(0.5, "model"),
        ),
    },
    "gate_b": {
        "budget_reference": "chunked_bc",
        "mode_minimum_share": 0.125,
        "unmatched": {},
        "limits": by_owner(
            unmatched_keys=(0, "model"),
            parameter_budget_deviation=(0.05, "model"),
            unpinned_items=(0, "model"),
            nonfinite_weights=(0, "model"),
            metadata_mismatches=(0, "model"),
            samples_difference=(0, "model"),
            varied_difference=(1e-5, "model"),
            nfe_mismatch=(0, "model"),
            conformance=(0, "model"),
            mode_coverage_lower=(0.6, "model"),
            outside_modes_upper=(0.25, "model"),
            late_change_upper=(0.15, "model"),
            baseline_fall_upper=(0.1, "model"),
            latency_terms_missing=(0, "perception"),
            warm_latency_ratio_upper=(1.5, "controller"),
            cold_latency_ratio_upper=(2.0, "controller"),
            latency_model_ratio_upper=(1.25, "controller"),
        ),
    },
    "gate_c": {
        "required_fixtures": list(FIXTURES[2:]),
        "mode_observations": 30,
        "limits": by_owner(
            mode_admissible_gap=(0.3, "controller"),
            admissible_share=(0.6, "model"),
            projection_p95_m=(0.02, "controller"),
            boundary_jerk_p95_m_s3=(500, "controller"),
            corrupted_refused_share=(1, "controller"),
            changed_answers=(0, "safety"),
            stub_stale=(0, "safety"),
            stub_invalid=(0, "safety"),
            stub_violation_upper=(0.01, "safety"),
            conservation_error=(0, "controller"),
            incidents_miscounted=(0, "safety"),
            checker_violations=(0, "safety"),
            mutants_undetected=(0, "safety"),
        ),
    },
    "gate_d": {
        "monitor_costs": by_owner(
            missed_failure=(10.0, "safety"),
            alarmed_failure=(2.0, "safety"),
            false_alarm=(1.0, "model"),
        ),
        "tolerances": by_owner(age_distance=(0.15, "controller"), share=(0.1, "controller")),
        "limits": by_owner(
            unmatched_starts=(0, "model"),
            verdict_reachable=(0.8, "model"),
            nominal_success_lower=(0.7, "model"),
            deadline_miss_upper=(0.1, "controller"),
            latency_p95_s=("derived", "controller"),
            hold_share_upper=(0.25, "controller"),
            rejection_share_upper=(0.2, "model"),
            reset_upper=(0.1, "safety"),
            recovery_success_lower=(0.5, "safety"),
            fallback_share_upper=(0.15, "safety"),
            intervention_upper=(0.1, "safety"),
            changed_answers=(0, "safety"),
            stub_violations=(0, "safety"),
            force_peak_p95_n=(20, "safety"),
            stress_success_lower=(0.6, "model"),
            conservation_error=(0, "controller"),
            checker_violations=(0, "safety"),
            promotion_e_value=("derived", "model"),
        ),
    },
    "gate_e": {
        "maximum_days": 30,
        "limits": by_owner(
            upstream_passed=(1, "safety"),
            draft_complete=(0, "safety"),
            signature_valid=(1, "safety"),
            reviewer_independent=(1, "safety"),
            owners_signed=(4, "safety"),
            envelope_within_limits=(0, "safety"),
            not_expired=(1, "safety"),
        ),
    },
    "card": {
        "name": "trial",
        "authors": ["ada"],
    },
}


def write_params(root: Path, change: Callable[[dict[str, Any]], Any] | None = None) -> None:
    """params.yaml, as `change` leaves it (in place)."""
    params = copy.deepcopy(PARAMS)
    if change:
        change(params)
    (root / "params.yaml").write_text(yaml.dump(params, Dumper=yaml.CSafeDumper, sort_keys=False))
    record(root)


def set_limit(gate: str, name: str, limit: Any) -> Callable[[dict[str, Any]], None]:
    """A change for `write_params`: another limit of one criterion, by its owner and reason."""

    def change(params: dict[str, Any]) -> None:
        for entries in params[gate]["limits"].values():
            if name in entries:
                entries[name][0] = limit

    return change


def limited(gate: str) -> set[str]:
    """Criteria of a gate that have a limit and are asked of who was trained here."""
    of_brought = OF_BROUGHT.get(gate[-1].upper(), set())
    return {name for entries in PARAMS[gate]["limits"].values() for name in entries} - of_brought


def table(root: Path, path: str, row: type, rows: list[dict[str, Any]]) -> None:
    write_rows(root / "artifacts" / path, row, [row(**values) for values in rows])


def document(root: Path, path: str, value: Any) -> None:
    file = root / "artifacts" / path
    file.parent.mkdir(parents=True, exist_ok=True)
    file.write_bytes(canonical_json(value))


def edit_table(root: Path, path: str, change: Any) -> None:
    """Apply `change` (a function of the data frame) to one table."""
    file = root / "artifacts" / path
    before = read_table(file).to_pandas()
    frame = change(before.copy())
    if path == "stress/rollouts.parquet":
        frame = as_it_ticked(before, ended_as_it_counts(before, frame))
    if path == "shadow/candidates.parquet":
        frame = as_the_layers_say(before, frame)
    write_table(file, pa.Table.from_pandas(pd.DataFrame(frame), preserve_index=False))
    if path == "stress/rollouts.parquet" and not {"recovery_attempted", "recovered"} - set(frame):
        table(root, "stress/recoveries.parquet", RecoveryRow, recoveries_of(frame))
    if path == "latency/latency.parquet":
        with contextlib.suppress(Exception):  # of times that are none there is no model
            model_again(root)
    record(root)


def recoveries_of(frame: pd.DataFrame) -> list[dict[str, Any]]:
    """One entry into recovery of each rollout that attempted one, that says as much as it does."""
    begun = frame[frame["recovery_attempted"].fillna(False).astype(bool)]  # a cell may be empty
    return [_entry(row) for row in begun.to_dict("records")]


def _entry(row: dict[str, Any]) -> dict[str, Any]:
    start, drill = row["start"], row["perturbation"] == "recovery_drill"
    ended = "handed_back"
    if not row["success"]:
        ended = {"collision": "stopped"}.get(row["outcome"], ("person", "timed_out")[start % 2])
    return {
        "method": row["method"], "seed": row["seed"], "perturbation": row["perturbation"],
        "start": start, "recovery": 0, "phase": ("approach", "align", "insert")[start % 3],
        "cause": "drill" if drill else "silence", "primitives": "retreat classical_return",
        "failures": int(ended == "timed_out"), "ended": ended,
        "resampled_only": row["success"] and not row["recovered"],
        "taken_over": ended == "handed_back", "succeeded": row["success"],
        "recovered": row["recovered"], "duration_s": 2.0 + 0.01 * start,
        "force_peak_n": 0.5 * (start % 7), "resets": int(ended == "stopped"),
    }  # fmt: skip


def ended_as_it_counts(before: pd.DataFrame, frame: pd.DataFrame) -> pd.DataFrame:
    """Rollouts that count as they ended, where an edit sets one of the two and not the other."""
    if {"success", "outcome"} - set(frame):
        return frame
    was = before.reindex(frame.index)
    counts, ends = (frame[name].eq(was[name]) for name in ("success", "outcome"))
    ended = frame["success"].map({True: "success", False: "timeout"})
    outcome = frame["outcome"].where(counts | ~ends | ended.isna(), ended)
    success = frame["success"].where(ends | ~counts, frame["outcome"].eq("success"))
    return frame.assign(outcome=outcome, success=success)


def lags_apart(frame: pd.DataFrame) -> pd.DataFrame:
    """Clocks whose epochs lag by 2 and by 6 steps: one criterion of gate A fails, no other."""
    return frame.assign(lag_rows=frame["epoch"].map({"e1": 2.0, "e2": 6.0}))


def finding(question: str, measured: float) -> pd.DataFrame:
    """`findings.parquet` with one deviation."""
    row = Finding(
        kind="clock", variable="robot", where="epoch e1", question=question,
        measured=measured, floor=0.0, unit="", action="Correct it.",
    )  # fmt: skip
    return pd.DataFrame([vars(row)])


def edit_document(root: Path, path: str, change: Any) -> None:
    """Apply `change` (in place, or returning the new value) to one JSON document."""
    file = root / "artifacts" / path
    value = json.loads(file.read_bytes())
    document(root, path, change(value) or value)
    if path.endswith("matched.json"):
        follow(root)
    record(root)


def replace(root: Path, path: str, data: bytes | None) -> None:
    """Other bytes in place of a file, as if its stage had written them; None removes it."""
    file = root / "artifacts" / path
    file.write_bytes(data) if data is not None else file.unlink()
    record(root)


def build(root: Path) -> None:
    """All evidence and settings, without any report."""
    write_params(root)
    (root / PREREGISTRATION).write_bytes(plan_bytes(PARAMS))
    document(root, "task/identity.json", TASK)
    _dataset(root)
    _audit(root)
    _baselines(root)
    _factors(root)
    _generators(root)
    _reload(root)
    follow(root)
    _latency(root)
    _candidates_drawn(root)
    _shadow(root)
    _stress(root)
    _clocks(root)
    write_watched(root)
    (root / CODE).parent.mkdir(parents=True)
    (root / CODE).write_text("STIFFNESS = 1\n")
    (root / "dvc.yaml").write_text(yaml.safe_dump({"stages": {}}))
    record(root)


def record(root: Path) -> None:
    """Pipeline and lock as if every evidence stage had just written what lies here."""
    if not (root / "dvc.yaml").is_file():
        return
    disk = pipeline.Disk(root, {})
    params = _read_again((root / "params.yaml").read_text()) or {}
    stages, runs = {}, {}
    for gate, names in pipeline.RUNGS.items():
        for name in names:
            outs = [out for out in [folder_of(name)] if (root / out).is_dir()]
            keys = [name] if isinstance(params, dict) and name in params else []
            stages[name] = {"cmd": name, "deps": [CODE], "params": keys, "outs": outs}
            runs[name] = {
                "cmd": name,
                "deps": [{"path": CODE, "md5": disk.md5(CODE)}],
                "params": {"params.yaml": {key: params[key] for key in keys}},
                "outs": [{"path": out, "md5": disk.md5(out)} for out in outs],
            }
        stages[f"gate_{gate.lower()}"] = {"cmd": "gate", "deps": [CODE], "outs": []}
    # In lines: of a text in one line the reader takes the depth for its length (the slow parser).
    (root / "dvc.yaml").write_text(json.dumps({"stages": stages}, indent=0))
    (root / "dvc.lock").write_text(json.dumps({"schema": "2.0", "stages": runs}, indent=0))


@functools.lru_cache(maxsize=4)
def _read_again(text: str) -> Any:
    """Settings, which few edits of evidence change; do not write into them."""
    return yaml.load(text, Loader=yaml.CSafeLoader)


def _dataset(root: Path) -> None:
    refused = [{"file": "x", "where": "x", "reason": "too short"}]
    document(root, "ingest/refusals.json", {"found": 50, "accepted": 49, "refused": refused})
    frames: list[dict[str, Any]] = [
        {
            "episode_uuid": f"e{e}",
            "index": i,
            "event_time_s": 0.1 * i,
            "observation": [0.1 * e],
            "action": [0.38 + 0.03 * i, _bow(e, i), 0.15] * 3,
            "phase": "approach",
        }
        for e in range(4)
        for i in range(9)
    ]
    table(root, "ingest/frames.parquet", FrameRow, frames)
    training = [row for row in frames if row["episode_uuid"] in ("e0", "e1")]
    statistics = {name: _extremes([row[name] for row in training]) for name in
                  ("observation", "action")}  # fmt: skip
    manifest = {"schema_version": 1, "normalisation": statistics, **SPLIT}
    document(root, "ingest/manifest.json", manifest)
    table(
        root,
        "ingest/episodes.parquet",
        EpisodeRow,
        [
            {
                "episode_uuid": f"e{e}",
                "split": ("train", "train", "validation", "test")[e],
                "task": "t",
                "object": "o",
                "operator": "p",
                "calibration_epoch": "c0",
                "outcome": "failure" if e == 3 else "success",
                "is_recovery": False,
                "is_intervention": None,
                "source_file": f"{e}.mcap",
                "source_sha256": "",
                "content_sha256": "",
                "rows": 9,
                "lead_rows": 0,
                "recorded_at_s": float(e),
                "lead_action": [],
                "scene_start": "",
            }
            for e in range(4)
        ],
    )


def _extremes(rows: list[list[float]]) -> dict[str, list[float]]:
    columns = list(zip(*rows, strict=True))
    return {"minimum": [min(c) for c in columns], "maximum": [max(c) for c in columns]}


def _bow(episode: int, index: int) -> float:
    """Lateral position of a path: to larger y in even episodes, else to smaller."""
    return 0.13 * (1 if episode % 2 == 0 else -1) * (1 - ((index - 4) / 4) ** 2)


def _component(name: str) -> dict[str, object]:
    """Modes of the position; nothing beside it."""
    followed = name == "position"
    return {
        "component": name, "state": "varies", "unit": "m", "separation": 0.03, "scale": 0.01,
        "spread": 0.01, "situations": 90, "clusters": 50 * followed, "two_mode": 50 * followed,
        "two_mode_episodes": 30 * followed, "incoherent": 0, "persistent": 50 * followed,
        "followed": followed,
    }  # fmt: skip


def _audit(root: Path) -> None:
    photo = root / "artifacts/audit/scene.png"
    photo.parent.mkdir(parents=True, exist_ok=True)
    photo.write_bytes(PNG)
    table(
        root,
        "audit/clocks.parquet",
        Clock,
        [
            {
                "stream": stream,
                "epoch": epoch,
                "episodes": 20,
                "offset_before_s": 0.03,
                "offset_after_s": 0.002,
                "lag_rows": 2.0,
                "receive_delay_p50_s": 0.02,
                "receive_delay_p95_s": 0.05,
                "jitter_p95_s": 0.004,
            }
            for stream in ("robot", "camera")
            for epoch in ("e1", "e2")
        ],
    )
    table(
        root,
        "audit/calibration.parquet",
        Calibration,
        [{"epoch": e, "episodes": 20, "residual_m": 0.001} for e in ("e1", "e2")],
    )
    table(root, "audit/neighbourhoods.parquet", SituationRow, [_situation(i) for i in range(60)])
    names = ("position", "rotation", "gripper", "timing")
    table(root, "audit/components.parquet", ComponentModes, [_component(name) for name in names])
    calm = {"column": "x_m", "ratio": 0.1, "spread": 0.05, "white_share": 0.02}
    table(root, "audit/tremor.parquet", Tremor, [calm])
    table(
        root,
        "audit/modes.parquet",
        ModeOutcome,
        [
            {
                "mode": mode,
                "phase": "approach",
                "episodes": 25,
                "successes": 24,
                "success_lower": 0.8,
                "success_upper": 1.0,
                "admissible": 49,
                "checked": 50,
            }
            for mode in ("left", "right")
        ],
    )
    table(
        root,
        "audit/strata.parquet",
        Stratum,
        [
            {
                "variable": variable,
                "phase": "approach",
                "p_value": 0.4,
                "p_adjusted": 0.9,
                "effect": 0.05,
                "effect_lower": 0.0,
                "effect_upper": 0.2,
                "n": 100,
                "recorded": True,
                "observed": False,
                "detail": "",
            }
            for variable in ("operator", "object", "epoch")
        ],
    )
    names = ("labels", "constant_lag", "operator")
    asked = [{"check": name, "asked": True, "reason": ""} for name in names]
    table(root, "audit/asked.parquet", Asked, asked)
    told = [_told(name) for name in ("operator", "object")]
    table(root, "audit/predictions.parquet", Prediction, told)
    table(
        root,
        "audit/replay.parquet",
        ReplayRow,
        [
            {
                "episode_uuid": f"e{i}",
                "label": "success",
                "replayed": "success",
                "mode": ("m0", "m1")[i % 2],
            }
            for i in range(40)
        ],
    )
    table(root, "audit/examples.parquet", ExampleChunk, [_example(i) for i in range(12)])
    table(
        root,
        "audit/alignment.parquet",
        Alignment,
        [
            {
                "episode_uuid": f"e{i}",
                "epoch": "c0",
                "order": float(i),
                "lag_rows": 2.0,
                "offset_before_s": 0.01 * (i % 2),
                "offset_after_s": 0.0,
            }
            for i in range(10)
        ],
    )
    followed = [
        {"episode_uuid": f"e{e}", "phase": "approach", "mode": f"m{e % 2}"} for e in range(4)
    ]
    table(root, "audit/demonstrated.parquet", Demonstration, followed)
    table(root, "audit/findings.parquet", Finding, [])
    table(root, "audit/resamples.parquet", Resample, [_draw() for _ in range(4)])
    document(
        root,
        "audit/persistence.json",
        {"observed": 0.95, "null_q95": 0.6, "null_mean": 0.5, "n": 200},
    )
    table(
        root,
        "audit/recovery.parquet",
        RecoveryOutcome,
        [
            {"split": "recovery", "mode": "left", "episodes": 40, "successes": 38},
            {"split": "recovery", "mode": "right", "episodes": 40, "successes": 8},
        ],
    )
    table(
        root,
        "audit/reach.parquet",
        Reach,
        [{"kind": "local", "fifth": k, "queries": 20, "spoke": 18} for k in range(1, 6)],
    )
    table(
        root,
        "audit/alternatives.parquet",
        Alternative,
        [{"phase": "approach", "mode": "left", "other": "right", "situations": 40}],
    )
    table(root, "audit/structure_draws.parquet", StructureDraw, [_structure_draw()] * 4)
    table(root, "audit/finding_draws.parquet", FindingDraw, [])
    table(root, "audit/sides.parquet", Side, [_side("local"), _side("learned")])
    document(
        root,
        "audit/summary.json",
        {
            "floors": {},
            "ceilings": {},
            "metre": 1.0,
            "primary_phase": "approach",
            "episodes": 100,
            "rows": 9000,
            "gaps": 0,
            "start_drift": 0.0,
            "notes": [],
            "mean_checked": 40,
            "mean_defeated": 38,
            "counts": {
                "queries": 100,
                "analysed": 90,
                "analysed_episodes": 40,
                "two_mode": 50,
                "two_mode_episodes": 30,
                "primary_episodes": 40,
                "resolved": 0,
                "incoherent": 0,
                "persistent": 45,
                "noise_ratio": 0.1,
                "noise_spread": 0.01,
                "white_share": 0.02,
            },
            "modes_before_realignment": 3,
            "modes_after_realignment": 2,
            "modes_with_phase": 40,
            "modes_without_phase": 42,
            "position_names": ["x", "y", "z"],
            "position_unit": "m",
            "obstacles": [{"x_m": 0.5, "y_m": 0.0, "radius_m": 0.025}],
        },
    )


def _told(variable: str) -> dict[str, Any]:
    return {
        "variable": variable,
        "phase": "approach",
        "told": 0.05,
        "told_lower": -0.08,
        "told_upper": 0.18,
        "right": 0.53,
        "chance": 0.5,
        "n": 150,
        "detail": "",
    }


def _draw() -> dict[str, Any]:
    return {
        "disagreements": 0,
        "disagreement_upper": 0.06,
        "two_mode": 50,
        "two_mode_episodes": 30,
        "incoherent": 0,
        "persistent": 45,
        "kept": 0.95,
        "kept_null_q95": 0.6,
        "kept_n": 200,
        "p_adjusted": [0.9] * 3,
        "effect": [0.05] * 3,
        "effect_lower": [0.0] * 3,
        "told": [0.05] * 2,
        "success_lower": [0.8] * 2,
        "admissible": [49] * 2,
    }


def _side(kind: str) -> dict[str, Any]:
    counts = {name: value for name, value in _structure_draw().items() if "reach" not in name}
    del counts["findings"], counts["successes"]
    return counts | {
        "kind": kind,
        "followed": kind == "local",
        "two_mode": 50,
        "two_mode_episodes": 30,
        "incoherent": 0,
        "persistent": 45,
        "kept": 0.95,
        "kept_null_q95": 0.6,
        "kept_n": 200,
        "confirmed": 0,
        "contradicted": 0,
    }


def _structure_draw() -> dict[str, Any]:
    return {
        "queries": 100,
        "analysed": 90,
        "analysed_episodes": 40,
        "primary_episodes": 40,
        "resolved": 0,
        "noise_ratio": 0.1,
        "noise_spread": 0.01,
        "white_share": 0.02,
        "reach_queries": [20] * 5,
        "reach_spoke": [18] * 5,
        "findings": -1,
        "successes": [24] * 2,
    }


def _example(i: int) -> dict[str, Any]:
    path = [v for k in range(16) for v in (0.37 + 0.02 * k, (-1) ** i * 0.01 * k, 0.15)]
    return {
        "example": 0,
        "phase": "approach",
        "two_mode": True,
        "query_uuid": "e1",
        "query_index": 4,
        "episode_uuid": f"e{i}",
        "is_query": i == 0,
        "distance": 0.1 * i,
        "cluster": i % 2,
        "coordinate": (-1.0) ** i * 0.05,
        "path": path,
    }


NAMED = tuple(i for i in range(45) if i % 3)
"""Held-out situations in which two routes persist: policies are put before each of them."""


def _situation(i: int) -> dict[str, Any]:
    xs = [0.37 + 0.02 * k for k in range(16)]
    left = [v for x in xs for v in (x, 0.13 * (1 - abs(x - 0.5) / 0.2), 0.15)]
    right = [v for x in xs for v in (x, -0.13 * (1 - abs(x - 0.5) / 0.2), 0.15)]
    mean = [v for x in xs for v in (x, 0.0, 0.15)]
    return {
        "split": ("train", "validation", "test")[i % 3],
        "phase": "approach",
        "episode_uuid": f"e{i}",
        "index": i,
        "neighbours": 12,
        "clusters": 2,
        "cluster_sizes": [6, 6],
        "two_mode": True,
        "separation_m": 0.2,
        "mean_admissible": False,
        "mean_reason": "collision",
        "median_admissible": False,
        "modes_admissible": 2,
        "mean_path": mean,
        "mode_paths": [left, right],
        "persistent": True,
        "component": "position" if i in NAMED or i % 3 == 0 else "timing",
    }


def _modes(
    methods: tuple[str, ...], covered: int, *, nfe: int = 1, convention: str = "direct"
) -> list[dict[str, Any]]:
    return [
        {
            "method": method,
            "seed": 0,
            "convention": convention,
            "episode_uuid": f"e{i}",
            "index": i,
            "samples": 16,
            "modes_present": 2,
            "modes_covered": covered,
            "between_modes": 0,
            "far_from_modes": 0,
            "admissible": 16,
            "valid": 16 if covered else 0,
            "modes_valid": covered,
            "fewest_admissible": 7 if covered > 1 else 0,
            "nfe": nfe,
            "spread_m": 0.0,
        }
        for method in methods
        for i in NAMED
    ]


def _offline(method: str) -> dict[str, Any]:
    return {
        "method": method,
        "seed": 0,
        "split": "test",
        "phase": "approach",
        "windows": 9,
        "masked_mae": 0.02,
        "position_rmse_m": 0.01,
    }


def _matched(methods: tuple[str, ...], *, dataset: str) -> dict[str, Any]:
    sizes = {
        "parameters": {"encoder": 10, "trunk": 80, "head": 10, "total": PARAMETERS},
        "training_only_parameters": 0,
        "flops": {"encoder": 1, "trunk": 1, "head": 1, "total": 3},
    }
    extent = {"minimum": [0.0], "maximum": [1.0]}
    config = {
        "format_version": 1,
        "horizons": {
            "observation_horizon": 2,
            "prediction_horizon": 16,
            "execution_horizon": 8,
            "action_period_s": 0.05,
        },
        "dimensions": {"observation_dim": 1, "action_dim": 9},
        "normalisation": {"observation": extent, "action": extent},
        "network": NetworkConfig().model_dump(mode="json"),
        "head": HeadConfig().model_dump(mode="json"),
        "training": TrainingConfig(updates=UPDATES).model_dump(mode="json"),
        "training_seed": 0,
        "sampler": SamplerConfig(name=SAMPLER, steps=STEPS).model_dump(mode="json"),
        "provenance": {
            "dataset_manifest_sha256": dataset,
            "action_contract_sha256": "a" * 64,
            "observation_contract_sha256": "b" * 64,
            "episodes_sha256": None,
        },
        "weights_sha256": "0" * 64,
        **sizes,
    }
    return {
        "reference": methods[0],
        "methods": {m: {**sizes, "config": {**config, "method": m}} for m in methods},
        "differing_keys": {m: ["head"] for m in methods},
        "single_action_keys": [],
        "one_mode_keys": [],
    }


def _checkpoints(root: Path, stage: str, methods: tuple[str, ...]) -> None:
    for method in methods:
        folder = root / "artifacts" / stage / method / "seed_0"
        folder.mkdir(parents=True, exist_ok=True)
        (folder / "model.safetensors").write_bytes(weights(method))
        (folder / "config.json").write_bytes(b"{}\n")  # of who is matched: `follow`
        given = {"episodes": ["e0", "e1"], "validation_episodes": ["e2"]}
        document(root, f"{stage}/{method}/seed_0/training.json", given)
        table(root, f"{stage}/{method}/seed_0/validation.parquet", ValidationRow, validation())


def weights(
    name: str, values: Sequence[float] = (0.5,) * PARAMETERS, *, kind: str = "F32"
) -> bytes:
    """A file of weights by hand: the length of its header, the header, one tensor."""
    data = np.asarray(values, dtype={"F32": "<f4", "F64": "<f8"}[kind]).tobytes()
    tensor = {"dtype": kind, "shape": [len(values)], "data_offsets": [0, len(data)]}
    header = json.dumps({"__metadata__": {"name": name}, "w": tensor}).encode()
    return len(header).to_bytes(8, "little") + header + data


def checkpoint_sha256(folder: Path) -> str:
    """Identity of the checkpoint that lies in a folder."""
    files = (folder / "model.safetensors", folder / "config.json")
    parts = [hashlib.sha256(file.read_bytes()).hexdigest() for file in files]
    return hashlib.sha256("".join(f"{part}\n" for part in parts).encode()).hexdigest()


def follow(root: Path) -> None:
    """Configurations, pins and fixtures as a training would have left them with `matched.json`."""
    for stage in ("train_baselines", "train_generators"):
        place = root / "artifacts" / stage
        said = json.loads((place / "matched.json").read_bytes())["methods"]
        for file in sorted(place.glob("*/seed_*/config.json")):
            if entry := said.get(file.parent.parent.name):
                number = int(file.parent.name.removeprefix("seed_"))
                own = {"training_seed": 7 * number} if number else {}
                file.write_bytes(canonical_json({**entry["config"], **own}))
    pinned = json.loads((root / "artifacts/reload/identity.json").read_bytes())
    known = {name: entry for name, entry in pinned.items() if name in said}
    for name, entry in known.items():
        folders = sorted((place / name).glob("seed_*"))
        config = said[name]["config"]
        entry |= {
            "checkpoints": [checkpoint_sha256(folder) for folder in folders],
            "config": [_sha256((folder / "config.json").read_bytes()) for folder in folders],
            "normalisation": _sha256(canonical_json(config["normalisation"])),
            "sampler": _sha256(canonical_json(config["sampler"])),
        }
        entry["checkpoint"] = entry["checkpoints"][0]
    document(root, "reload/identity.json", pinned)
    _fixtures_drawn(root, known)


def _sha256(data: bytes) -> str:
    return hashlib.sha256(data).hexdigest()


def _fixtures_drawn(root: Path, pinned: dict[str, Any]) -> None:
    """As training drew them, so that what reload says of them is so."""
    samples = read_table(root / "artifacts/reload/samples.parquet").to_pandas()
    counted = read_table(root / "artifacts/reload/nfe.parquet").to_pandas()
    recorded = counted.set_index(["method", "seed"])["recorded"]
    rows = [
        {
            "method": row["method"], "seed": row["seed"], "row": row["row"],
            "checkpoint": pinned[row["method"]]["checkpoint"],
            "sampler": pinned[row["method"]]["sampler"],
            "nfe": int(recorded[row["method"], row["seed"]]), "prediction_horizon": 16,
            "sha256": row["sha256_trained"], "samples": [0.0],
        }
        for row in samples.to_dict("records") if row["method"] in pinned
    ]  # fmt: skip
    table(root, "train_generators/fixtures.parquet", TrainedFixture, rows)


def validation(fall: float = 0.04) -> list[dict[str, Any]]:
    """Validation loss of 20 episodes, falling by `fall` over the last quarter."""
    uneven = {count: 0.002 * (count == UPDATES) for count in (2000, 3000, UPDATES)}
    return [
        {
            "updates": count,
            "episode_uuid": f"e{e}",
            "windows": 32,
            "loss": loss * (1 + 0.1 * (e % 3)) * (1 + uneven[count] * (-1) ** e),
        }
        for e in range(20)
        for count, loss in ((2000, 1.5), (3000, 1.0), (UPDATES, 1.0 - fall))
    ]


def _baselines(root: Path) -> None:
    refused = {"admissible": 0, "valid": 0, "modes_valid": 0}
    fixed = [{**row, **refused} for row in _modes(BASELINES, 1)]
    fixed += [
        {**row, **refused, "convention": REMEDIES[row["method"]]}
        for row in _modes(tuple(REMEDIES), 1)
    ]
    drawn = [{**row, "convention": "derivative_free"} for row in _modes((DRAWN,), 2)]
    table(root, "measure_baselines/modes.parquet", ModeRow, fixed + drawn)
    dataset = _sha256((root / "artifacts/ingest/manifest.json").read_bytes())
    matched = _matched((*BASELINES, *REMEDIES, DRAWN), dataset=dataset)
    document(root, "train_baselines/matched.json", matched)
    table(root, "measure_baselines/offline.parquet", OfflineRow, [_offline("bc")])
    latent = {
        "method": "act", "convention": "z_prior", "seed": 0, "situations": 30, "spread_m": 0.03,
        "condition_share": 0.4, "distance_correlation": 0.6, "exceeding": 0, "permutations": 999,
    }  # fmt: skip
    document(root, "measure_baselines/latent.json", [latent])
    _checkpoints(root, "train_baselines", (*BASELINES, *REMEDIES, DRAWN))


def _factors(root: Path) -> None:
    modes, errors = [], []
    for place, (name, (factor, convention, _, _)) in enumerate(VARIANTS.items()):
        named = {"variant": name, "factor": factor, "convention": convention}
        covered = 2 if factor == "head" else 1
        refused = {"admissible": 0, "valid": 0, "modes_valid": 0}
        modes += [{**row, **named, **refused} for row in _modes((name,), covered)]
        errors += [
            {
                **named, "seed": 0, "split": "test", "episode_uuid": f"e{i}", "windows": 9,
                "chunk_error": 0.02 + 0.001 * place + 0.0001 * i,
                "first_error": 0.01 + 0.0001 * (i + place),
            }
            for i in range(30)
        ]  # fmt: skip
    table(root, "measure_factors/modes.parquet", FactorModeRow, modes)
    table(root, "measure_factors/errors.parquet", FactorErrorRow, errors)
    effects = [
        {
            "variant": name, "factor": factor, "convention": convention, "measure": measure,
            "value": 0.5, "reference": 0.4, "effect": 0.1 * place, "lower": 0.1 * place - 0.05,
            "upper": 0.1 * place + 0.05, "episodes": 30,
        }
        for place, (name, (factor, convention, _, _)) in enumerate(VARIANTS.items())
        for measure in ("chunk_error", "mode_coverage", "valid_share")
    ]  # fmt: skip
    table(root, "measure_factors/effects.parquet", EffectRow, effects)
    variants = {
        name: {
            "factor": factor,
            "method": "chunked_bc",
            "parameters": {"encoder": 10, "trunk": 80, "head": 10, "total": 100},
            "changed": changed,
            "allowed": changed,
            "prediction_horizon": horizon,
        }
        for name, (factor, _, horizon, changed) in VARIANTS.items()
    }
    document(
        root,
        "train_factors/variants.json",
        {"reference": "reference", "updates": 10, "variants": variants},
    )
    _checkpoints(root, "train_factors", tuple(VARIANTS))


def _generators(root: Path) -> None:
    drawn = _modes(CANDIDATES, 2, nfe=STEPS, convention=SAMPLER)
    for name in ("modes", "modes_earlier"):
        table(root, f"reload/{name}.parquet", ModeRow, drawn)
    manifest = (root / "artifacts/ingest/manifest.json").read_bytes()
    dataset = hashlib.sha256(manifest).hexdigest()
    matched = _matched(("chunked_bc", *CANDIDATES), dataset=dataset)
    # The reference is the baseline's checkpoint as it lies there.
    given = json.loads((root / "artifacts/train_baselines/matched.json").read_bytes())
    matched["methods"]["chunked_bc"] = given["methods"]["chunked_bc"]
    document(root, "train_generators/matched.json", matched)
    document(root, "candidates/candidates.json", {})
    table(root, "reload/offline.parquet", OfflineRow, [_offline("flow")])
    table(root, "reload/density.parquet", DensityRow, _densities())
    _checkpoints(root, "train_generators", CANDIDATES)


def _densities() -> list[dict[str, Any]]:
    """Sixteen situations with two modes; in every fourth the denser one is drawn less often."""
    return [
        {
            "method": method,
            "seed": 0,
            "episode_uuid": f"e{place}",
            "index": place,
            "mode": mode,
            "log_density": 100.0 - 4.0 * mode,
            "shape_distance_m": 0.0,
            "moved_m": 0.01,
            "samples": 16,
            "reached": (5 if mode else 9) if place % 4 else (9 if mode else 5),
        }
        for method in CANDIDATES
        for place in range(16)
        for mode in (0, 1)
    ]


def _reload(root: Path) -> None:
    manifest = (root / "artifacts/ingest/manifest.json").read_bytes()
    digest = hashlib.sha256(b"sample").hexdigest()
    table(
        root,
        "reload/samples.parquet",
        SampleRow,
        [
            {
                "method": m,
                "seed": 0,
                "device": "cpu",
                "row": i,
                "sha256_trained": digest,
                "sha256_reloaded": digest,
                "max_abs_difference": 0.0,
            }
            for m in CANDIDATES
            for i in range(8)
        ],
    )
    table(root, "reload/variations.parquet", VariationRow, [
        {
            "method": m,
            "seed": 0,
            "device": "cpu",
            "variation": way,
            "component": component,
            "chunks": 8 if way == "alone" else 16,
            "unequal": 0,
            "max_abs_difference": 0.0,
            "unknown": "",
        }
        for m in CANDIDATES
        for way in VARIATIONS
        for component in ACTION_COMPONENTS
    ])  # fmt: skip
    counted = {"encoder": (10, 1), "trunk": (80, 1), "head": (10, 1), "update": (0, 9)}
    table(root, "reload/compute.parquet", ComputeRow, [
        {"method": m, "seed": 0, "part": part, "parameters": parameters, "operations": operations}
        for m in CANDIDATES
        for part, (parameters, operations) in counted.items()
    ])  # fmt: skip
    # Nobody is brought; fixtures that were asked again are there for tests that bring one of them.
    document(root, "reload/conformance.json", {})
    table(root, "reload/answers.parquet", AnswerRow, [])
    for folder, conditions in (("shadow", ("shadow",)), ("stress", CONDITIONS)):
        table(
            root,
            f"{folder}/fixtures.parquet",
            FixtureAgainRow,
            [
                {
                    "method": m,
                    "condition": condition,
                    "when": when,
                    "row": i,
                    "answered": True,
                    "sha256": digest,
                }
                for m in CANDIDATES
                for condition in conditions
                for when in (BEFORE, AFTER)
                for i in range(8)
            ],
        )
    table(
        root,
        "reload/nfe.parquet",
        NfeRow,
        [
            {
                "method": m,
                "seed": 0,
                **dict.fromkeys(("recorded", "counted", "expected"), 8),
                "least": 8,
                "most": 8,
            }
            for m in CANDIDATES
        ],
    )
    table(
        root,
        "reload/coverage.parquet",
        CoverageRow,
        [
            {
                "method": m,
                "seed": 0,
                "sampler": "euler",
                "steps": nfe,
                "sampler_sha256": f"{m}{nfe}",
                "settings": "",
                "tolerance": None,
                "nfe": nfe,
                "situations": 30,
                "modes_covered_share": min(1.0, 0.7 + nfe / 30),
                "coverage_lower": min(1.0, 0.7 + nfe / 30) - 0.1,
                "spread_m": 0.1,
                "admissible_share": 0.9,
                "between_share": 0.0,
                "chunk_error": 0.1 + 0.1 / nfe,
                "nonfinite": 0,
                "given_up": 0,
                "jerk_p95_m_s3": 1000.0 + 100.0 / nfe,
            }
            for m in CANDIDATES
            for nfe in (2, 4, 8, 16)
        ],
    )
    document(
        root,
        "reload/identity.json",
        {
            m: {
                **dict.fromkeys(("checkpoint", "normalisation", "sampler"), ""),
                "checkpoints": [],
                "config": [],
                "dataset": hashlib.sha256(manifest).hexdigest(),
                "seed": [0],
                "metadata_mismatches": 0,
                "nonfinite_weights": 0,
                "nonfinite_chunks": 0,
                "given_up": 0,
                "card": _identity_card(hashlib.sha256(manifest).hexdigest()),
            }
            for m in CANDIDATES
        },
    )


def _identity_card(dataset: str) -> dict[str, Any]:
    """Of the configuration that `_matched` writes."""
    return {
        "architecture": "mlp encoder", "parameters": PARAMETERS, "training_seeds": ["0"],
        "dataset": dataset, "split": split_sha256(SPLIT), "action_semantics": "a" * 64,
        "observation_semantics": "b" * 64, "observation_horizon": 2, "prediction_horizon": 16,
        "execution_horizon": 8, "control_rate_hz": 20.0, "invocation_rate_hz": 4.0,
        "deadline_s": 0.15, "path": "straight", "sampler": SAMPLER, "sampler_steps": STEPS,
        "eta": None, "tolerance": None, "evaluations": "8", "precision": "float32",
        "device": "cpu", "threads": 1, "cpu_capability": "AVX2", "warm_up": 10, "batch_rows": 16,
        "candidates": 4, "selector": "first_admissible", "selector_owner": "model",
        "selector_sha256": "d" * 64,
    }  # fmt: skip


def _latency(root: Path) -> None:
    table(
        root,
        "latency/latency.parquet",
        LatencyRow,
        [
            {
                "method": m,
                "run": run,
                "process": process,
                "component": term,
                "owner": "model",
                "temperature": temperature,
                "repeat": i,
                "seconds": (SPEED[m] if term == "sample" else 0.001)
                * (1 + 0.01 * i + 0.02 * run + 0.01 * process),
                "source": "measured" if term in MEASURED_HERE else "declared",
                "waited_s": 1e-6 if term in MEASURED_HERE else None,
            }
            for m in (*CANDIDATES, *COMPARED)
            for run in (1, 2)
            for process in (1, 2, 3)
            for term in TERMS
            for temperature in ("cold", "warm")
            for i in range(8)
        ],
    )
    model_again(root)
    table(
        root,
        "latency/machine.parquet",
        MachineRow,
        [
            {
                "method": m,
                "run": run,
                "process": process,
                "seconds": 4.0 + SPEED[m],
                "cpu_s": 3.5,
                "voluntary": 40,
                "involuntary": 3 * run + process,
                "others_s": 0.1 * process,
                "stolen_s": 0.01 * run,
                "cpus": 2,
            }
            for m in (*CANDIDATES, *COMPARED)
            for run in (1, 2)
            for process in (1, 2, 3)
        ],
    )


def model_again(root: Path) -> None:
    """The model of the times that lie there, of every process."""
    times = read_table(root / "artifacts/latency/latency.parquet").to_pandas()
    known = times["waited_s"].notna() | (times["source"] != "measured")
    own = times[(times["source"] == "measured") & (times["temperature"] == "warm")]
    rows: list[dict[str, Any]] = []
    for method, part in own.groupby("method", sort=False):
        places = part[["run", "process"]].drop_duplicates().to_dict("records")
        keys = pd.DataFrame([{**p, "level": level} for p in places for level in (0.5, 0.95)])
        wall = quantiles_of(part, keys, uniforms(PARAMS["seed"]))
        found = keys.assign(
            **dict(zip(("measured_s", "drawn_s"), zip(*wall, strict=True), strict=True))
        )
        found = found.assign(measured_running_s=None, drawn_running_s=None, method=method)
        if known[times["method"] == method].all():
            alone = part.assign(seconds=part["seconds"] - part["waited_s"])
            ran = zip(*quantiles_of(alone, keys, uniforms(PARAMS["seed"])), strict=True)
            names = ("measured_running_s", "drawn_running_s")
            found = found.assign(**dict(zip(names, ran, strict=True)))
        rows += found.to_dict("records")
    table(root, "latency/model.parquet", LatencyModelRow, rows)


def _candidates_drawn(root: Path) -> None:
    table(
        root,
        "latency/sweep.parquet",
        SweepLatencyRow,
        [
            {
                "method": m,
                "sampler_sha256": f"{m}{nfe}",
                "candidates": 4,
                "repeat": repeat,
                "seconds": 1e-3 * nfe + 1e-5 * repeat,
            }
            for m in CANDIDATES
            for nfe in (2, 4, 8, 16)
            for repeat in range(5)
        ],
    )
    table(
        root,
        "latency/candidates.parquet",
        CandidatesRow,
        [
            {
                "method": m,
                "candidates": count,
                "load": load,
                "repeat": repeat,
                "seconds": SPEED[m] * (1 + count / 32 + 0.01 * repeat) * factor,
            }
            for m in CANDIDATES
            for count in (1, 4, 8, 32)
            for load, factor in (("none", 1), ("every core", 2))
            for repeat in range(5)
        ],
    )


def _candidate(method: str, fixture: str, observation: int, candidate: int) -> dict[str, Any]:
    held = fixture in ("held_out", "two_modes")
    broken = "joint_jerk" if candidate else REFUSED_FOR.get(fixture, "joint_jerk")
    layers: dict[str, Any] = dict.fromkeys(LAYERS, True)
    if not held:
        layers.update(dynamic=False, contact=None, fresh=None)
    return {
        "method": method,
        "seed": 0,
        "fixture": fixture,
        "situation": f"e{observation}:0",
        "phase": "approach",
        "observation": observation,
        "candidate": candidate,
        "mode": ("left", "right")[candidate % 2],
        **layers,
        "outcome": "passed" if held else "failed",
        "first_reason": "" if held else broken,
        "first_row": None if held else 2,
        "position_change_m": 0.001 * (1 + candidate) if held else None,
        "rotation_change_rad": 0.01,
        "boundary_jerk_m_s3": 50.0 + observation if held else None,
        "margins": [0.0] * len(FEASIBILITY_CHECKS),
        "raw": [0.0, 1.0],
        "projected": [0.0, 1.0],
    }


STILL = [
    *((f, phase, "hold", "empty", 40) for f in PLAYED for phase in ("approach", "insert")),
    *((f, "approach", "watchdog", "silence", 7) for f in PLAYED),
    ("clock_backwards_on_the_way", "insert", "doubt", "clock_backwards", 9),
    ("clock_forward_on_the_way", "insert", "watchdog", "clock_ahead", 1),
    ("stop_on_the_way", "approach", "hold", "stopped", 12),
]
"""Condition, phase, event, reason and how often; no stop, so that the page must say so."""


def _shadow(root: Path) -> None:
    rows = [
        _candidate(m, fixture, o, c)
        for m in CANDIDATES
        for fixture in FIXTURES
        for o in range({"held_out": 80, "two_modes": 60}.get(fixture, 4))
        for c in range(4)
    ]
    stated = said_of(pd.DataFrame(rows, dtype=object)).to_dict("records")
    table(root, "shadow/candidates.parquet", CandidateRow, stated)
    table(
        root,
        "shadow/stub.parquet",
        ShadowStubRow,
        [
            {"method": m, "fixture": f, "delivered": 400, "arrivals": 900, "stale": 0, "invalid": 0}
            for m in CANDIDATES
            for f in PLAYED
        ]
        + [
            {
                "method": m,
                "fixture": f,
                "delivered": 12 * moved,
                "arrivals": 24 * moved,
                "stale": 0,
                "invalid": 0,
            }
            for m in CANDIDATES
            for f, _, moved in INCIDENTS
        ],
    )
    table(
        root,
        "shadow/counts.parquet",
        ShadowCountRow,
        [
            {
                "method": m,
                "fixture": f,
                "generated": 100,
                "executed": 80,
                "queued": 5,
                "reason": reason,
                "count": n,
            }
            for m in CANDIDATES
            for f in PLAYED
            for reason, n in (("expired", 10), ("phase", 5))
        ]
        + [
            {
                "method": m,
                "fixture": f,
                "generated": 12 * (1 + moved),
                "executed": 12 * moved,
                "queued": 0,
                "reason": reason,
                "count": 12,
            }
            for m in CANDIDATES
            for f, reason, moved in INCIDENTS
        ],
    )
    table(
        root,
        "shadow/holds.parquet",
        ShadowHoldRow,
        [
            {
                "method": m,
                "fixture": f,
                "phase": phase,
                "event": event,
                "reason": reason,
                "count": n * (1 + (m == "flow")),
            }
            for m in CANDIDATES
            for f, phase, event, reason, n in STILL
        ],
    )
    document(root, "shadow/checker.json", checked("journal.mcap", 1000))
    document(root, "shadow/mutants.json", [mutant(layer, name) for layer, name in CHECKS])
    (root / "artifacts/shadow/journal.mcap").write_bytes(b"journal")
    document(root, "shadow/gallery.json", gallery())


def gallery() -> dict[str, Any]:
    """One rejected candidate of each method: a leap in row 2, in a scene of one post."""
    return {
        "workspace_m": [[0.3, -0.2, 0.02], [0.7, 0.2, 0.25]],
        "action_period_s": 0.05,
        "examples": [rejected(method) for method in CANDIDATES],
    }


def rejected(method: str, **changes: Any) -> dict[str, Any]:
    """An example of the gallery, with changes."""
    path = [[0.40 + 0.01 * k, 0.0, 0.15] for k in range(4)]
    box = [[0.49, 0.05], [0.51, 0.05], [0.51, 0.07], [0.49, 0.07]]
    post = {"name": "post", "kind": "obstacle", "touches": False, "above_m": box, "aside_m": box}
    example = {
        "method": method, "layer": "dynamic", "reason": "joint_jerk", "outcome": "failed",
        "rejected": 7, "held_out": 320, "situation": "e0:0", "phase": "approach", "mode": "left",
        "observation": 0, "candidate": 1, "row": 2, "late_rows": 1, "margin": -10.0,
        "unit": "rad/s^3", "limits": [100.0, 200.0], "touching": [],
        "commanded_m": [0.39, 0.0, 0.15], "raw_m": [*path[:2], [0.42, 0.03, 0.15], path[3]],
        "projected_m": path, "bodies": [post],
    }  # fmt: skip
    return {**example, **changes}


def checked(journal: str, actions: int) -> dict[str, Any]:
    """What the checker says of one journal with nothing wrong in it."""
    found = {"violations": [], "checked_actions": actions, "reproved_actions": actions}
    more = {
        "sessions": 1, "events": 9, "checked_fallback_actions": 0, "chunks": 9, "discarded": {},
        "oldest_action_s": 0.1, "longest_silence_s": 0.05,
    }  # fmt: skip
    return {**found, "journals": {journal: found | more}}


def mutant(layer: str, name: str) -> dict[str, Any]:
    """A check whose absence was noticed."""
    row = {"check": name, "layer": layer, "detected": True, "violations": 3}
    if layer == "execution":
        return row | {"rules": ["P1.age"], "violations_unchanged": 0, "slipped": 0}
    return row | {"fixture": name, "behind": [], "tried": 3, "not_applicable": ""}


VIOLATION = {"journal": "a.mcap", "session": "s", "event": 7, "rule": "P1.age", "text": "Too old."}


def _succeeds(method: str, start: int) -> bool:
    if method in COMPARED:
        return start % 2 == 0
    return not (method == "flow" and start == 7)


def _answer_s(method: str, lot: int) -> float:
    """Between 0.05 and 0.06 s; of diffusion, 0.02 s more."""
    return 0.05 + 0.0001 * (lot % 100) + (0.02 if method == "diffusion" else 0.0)


def _clocks(root: Path) -> None:
    """One candidate's clocks agree; by the wall clock the other misses every second deadline."""
    windows = [
        (method, clock, f"held_out_{n:02}")
        for method in CANDIDATES for clock in ("wall", "virtual") for n in range(48)
    ]  # fmt: skip

    def key(window: tuple[str, str, str]) -> dict[str, Any]:
        return dict(zip(("method", "clock", "episode"), window, strict=True))

    def late(method: str, clock: str, number: int) -> bool:
        return method == "diffusion" and clock == "wall" and number % 2 == 1

    asked = [(*window, number) for window in windows for number in range(3)]
    rows = [
        {
            **key((m, c, e)), "invocation": n, "in_time": True, "missed": late(m, c, n),
            "discarded_by": "expired" if late(m, c, n) else "", "replaced": not late(m, c, n),
        }
        for m, c, e, n in asked
    ]  # fmt: skip
    table(root, "wall_clock/invocations.parquet", ClockInvocationRow, rows)
    ages = [
        {**key((m, c, e)), "invocation": n, "row": row, "age_s": 0.05 * row + 0.001}
        for m, c, e, n in asked for row in (1, 2, 3) if not late(m, c, n)
    ]  # fmt: skip
    table(root, "wall_clock/ages.parquet", ClockAgeRow, ages)
    ticks = [{**key(w), "ticks": 16, "late_p95_s": 0.002, "late_max_s": 0.004} for w in windows]
    table(root, "wall_clock/ticks.parquet", ClockTickRow, ticks)
    names = [f"{m}__{c}.mcap" for m in CANDIDATES for c in ("wall", "virtual")]
    (root / "artifacts/wall_clock/journals").mkdir()
    for name in names:
        (root / "artifacts/wall_clock/journals" / name).write_bytes(b"journal")
    read = [checked(name, 100) for name in names]
    each = {name: of for one in read for name, of in one["journals"].items()}
    total = {"violations": [], "checked_actions": 400, "reproved_actions": 400}
    document(root, "wall_clock/checker.json", total | {"journals": each})


def _stress(root: Path) -> None:
    methods = (*COMPARED, *CANDIDATES)
    rows = []
    for method in methods:
        for condition in CONDITIONS:
            for start in range(STARTS):
                success = _succeeds(method, start)
                rows.append(
                    {
                        "method": method,
                        "seed": 0,
                        "perturbation": condition,
                        "start": start,
                        "start_sha256": hashlib.sha256(f"{condition}{start}".encode()).hexdigest(),
                        "outcome": "success" if success else "collision",
                        "success": success,
                        "duration_s": 8.0,
                        "ticks": 160,
                        "action_ticks": 150,
                        "hold_ticks": 8,
                        "fallback_ticks": 2,
                        "invocations": INVOCATIONS,
                        "deadline_misses": 0,
                        "discards": 1,
                        "rejections": 1,
                        "rejected_by": "",
                        "recovery_attempted": condition == "recovery_drill",
                        "recovered": success and condition == "recovery_drill",
                        "interventions": 0,
                        "person_s": 0.0,
                        "action_age_p50_s": 0.1,
                        "action_age_p95_s": 0.2 + 0.001 * start,
                        "action_age_max_s": 0.3,
                        "latency_p95_s": 0.05,
                        "force_peak_n": 5.0 + 0.1 * start,
                        "mode": "left",
                    }
                )
    table(root, "stress/rollouts.parquet", RolloutRow, rows)
    entered = recoveries_of(pd.DataFrame(rows))
    table(root, "stress/recoveries.parquet", RecoveryRow, entered)
    table(
        root,
        "stress/invocations.parquet",
        InvocationRow,
        [
            {
                "method": method,
                "seed": 0,
                "perturbation": condition,
                "start": start,
                "invocation": number,
                "latency_s": 0.9 if number == 0 else _answer_s(method, start + 7 * number),
            }
            for method in methods
            for condition in CONDITIONS
            for start in range(STARTS)
            for number in range(INVOCATIONS)
        ],
    )
    splices = [
        {
            "method": method, "seed": 0, "perturbation": condition, "start": start,
            "rule": "replace" if method in COMPARED else "real_time", "invocation": number,
            "parents": int(number > 0 and method not in COMPARED),
            "raw_jump_m": 0.001 * (start + number), "jump_m": 0.0005 * (start + number),
            "raw_jerk_m_s3": None if number == 0 else 100.0 * (start + number),
            "jerk_m_s3": None if number == 0 else 50.0 * (start + number),
        }
        for method in methods for condition in CONDITIONS
        for start in range(STARTS) for number in range(3)
    ]  # fmt: skip
    table(root, "stress/splices.parquet", SpliceRow, splices)
    cells = [(m, c) for m in methods for c in CONDITIONS]
    table(
        root,
        "stress/counts.parquet",
        StressCountRow,
        [{"method": m, "perturbation": c, "reason": "expired", "count": 10} for m, c in cells],
    )
    table(
        root,
        "stress/conservation.parquet",
        ConservationRow,
        [
            {
                "method": m,
                "perturbation": c,
                "generated": 100,
                "executed": 88,
                "discarded": 10,
                "queued": 2,
            }
            for m, c in cells
        ],
    )
    table(
        root,
        "stress/stub.parquet",
        StressStubRow,
        [
            {"method": m, "perturbation": c, "arrivals": 500, "stale": 0, "invalid": 0}
            for m, c in cells
        ],
    )
    table(
        root,
        "stress/overruns.parquet",
        OverrunRow,
        [
            {"method": m, "perturbation": c, "term": term, "action": action, "count": count}
            for m, c in cells if m in CANDIDATES
            for term, action, count in (("queue", "reject_stale", 3), ("select", "continue", 2))
        ],
    )  # fmt: skip
    document(root, "stress/checker.json", checked("a.mcap", 5000))
    document(root, "stress/envelope.json", ENVELOPE)
    # Of nobody who is judged here: a distilled candidate's is written by the test that asks.
    document(
        root,
        "stress/distilled.json",
        {
            "manicm": {
                "teacher": "diffusion",
                "teacher_sha256": "c" * 64,
                "updates": 2 * UPDATES,
                "evaluations": 4 * UPDATES,
                "gradients": 2 * UPDATES,
            }
        },
    )
    power = {"margin": 0.1, "alpha": 0.05, "pairs": STARTS}
    row = {"baseline_success": 0.5, "correlation": 0.6, "margin": 0.1, "pairs": STARTS,
           "median_pairs": 30.0}  # fmt: skip
    document(
        root,
        "stress/power.json",
        {
            **power,
            "rows": [
                {**row, "candidate_success": 0.95, "promote_share": 0.97, "return_share": 0.03},
                {**row, "candidate_success": 0.55, "promote_share": 0.02, "return_share": 0.98},
            ],
        },
    )
    journals = root / "artifacts/stress/journals"
    journals.mkdir(parents=True, exist_ok=True)
    (journals / "a.mcap").write_bytes(b"journal")
