"""The honest small ladders on which wrongs are planted, each built once.

`small` is the ladder of `tests/ladder`, through all gates, held to the signed limits wherever it
holds them (`limits.yaml` names the others). `brought` judges recordings of one's own by gate A,
with trainings of a few updates: for wrongs in the data. `signed` is the synthetic evidence of
`tests/gates` with a card that five people signed: a rehearsal can never be signed.
"""

import datetime
import json
import shutil
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any

import yaml

from benchmarks.ladder_truth.outcome import look, settled, verified
from benchmarks.ladder_truth.sealing import KEYS, SIGNERS
from gates.card.card import card_bytes
from gates.card.drafting import draft
from gates.proof import admit, judge
from gates.report import report_bytes, report_path

ROOT = Path(__file__).parents[2]
LIMITS = Path(__file__).with_name("limits.yaml")
TESTS = [str(ROOT / "tests" / folder) for folder in ("ladder", "gates", "gates/card")]
sys.path[:0] = [folder for folder in TESTS if folder not in sys.path]

import evidence  # noqa: E402
from ladder_workspace import copy_of, make_small_ladder  # noqa: E402
from team import Team  # noqa: E402

NOT_ASKED = {
    "gate_c": ("projection_p95_m", "boundary_jerk_p95_m_s3"),
    "gate_d": ("latency_p95_s", "force_peak_p95_n", "recovery_success_lower"),
}
"""What tests/ladder declares not applicable: a handful of starts forms no verdict."""
BROUGHT = "recordings"
VARIANTS = ("reference", "linear_encoder")
UNTRACKED = shutil.ignore_patterns("__pycache__")


def edit_params(workspace: Path, change: Callable[[dict[str, Any]], Any]) -> None:
    """Change `params.yaml` of a workspace."""
    path = workspace / "params.yaml"
    params = yaml.safe_load(path.read_text())
    change(params)
    path.write_text(yaml.safe_dump(params, sort_keys=False, allow_unicode=True))


def set_limit(workspace: Path, gate: str, criterion: str, limit: float) -> None:
    """Move one limit, whoever owns it."""

    def change(params: dict[str, Any]) -> None:
        owners = params[gate]["limits"].values()
        (entries,) = [entries for entries in owners if criterion in entries]
        entries[criterion][0] = limit

    edit_params(workspace, change)


def hold_to_limits(workspace: Path) -> Path:
    """Give a workspace of `tests/ladder` the signed limits, or those that `limits.yaml` names."""
    signed = yaml.safe_load((ROOT / "params.yaml").read_text())
    named = yaml.safe_load(LIMITS.read_text())

    def change(params: dict[str, Any]) -> None:
        for gate in ("gate_a", "gate_b", "gate_c", "gate_d"):
            params[gate]["limits"] = {
                owner: {
                    name: named.get(gate, {}).get(name, limit)
                    for name, limit in entries.items()
                    if name not in NOT_ASKED.get(gate, ())
                }
                for owner, entries in signed[gate]["limits"].items()
            }

    edit_params(workspace, change)
    return workspace


def small(target: Path, *, finished: Path | None = None) -> Path:
    """The small ladder, run to gate E; from a workspace of `tests/ladder` that ran, if given."""
    workspace = copy_of(finished, target) if finished else make_small_ladder(target)
    return settled(hold_to_limits(workspace))


def brought(target: Path, small_ladder: Path) -> Path:
    """Gate A alone, on recordings in a folder of one's own, with next to no training."""
    shutil.copytree(small_ladder, target, symlinks=True)
    episodes = target / "artifacts" / "record" / "episodes"
    shutil.copytree(episodes, target / BROUGHT)

    def change(params: dict[str, Any]) -> None:
        params["source"] = {"kind": "recordings", "path": BROUGHT}
        params["policy"]["training"] |= {"updates": 60, "warmup_updates": 5, "validation_every": 60}
        params["policy"]["fixtures"] = 4
        params["train_factors"]["updates"] = 5
        variants = params["train_factors"]["variants"]
        params["train_factors"]["variants"] = {name: variants[name] for name in VARIANTS}
        asked = {"factors": ["reference", "representation"]}
        params["gate_a"] |= {**asked, "conditioning_factors": ["representation"]}
        params["measure_baselines"]["samples"] = 2
        params["measure_factors"] |= {"samples": 2, "stride": 32}
        limits = {k: v for owner in params["gate_a"]["limits"].values() for k, v in owner.items()}
        for name in ("chunking_valid_share", "factor_valid_share", "baseline_mode_coverage",
                     "latent_dependence_p"):  # fmt: skip
            limits[name][:] = [1, "sixty updates: asked, but no verdict on a training"]

    edit_params(target, change)
    return settled(target, "gate_a")


def signed(target: Path) -> Path:
    """Synthetic evidence that passes every gate, and a card that five people have signed."""
    target.mkdir(parents=True)
    evidence.build(target)
    for name in ("genpolicy", "gates", "stages"):
        shutil.copytree(ROOT / name, target / name, dirs_exist_ok=True, ignore=UNTRACKED)
    evidence.record(target)
    (target / "reports").mkdir(exist_ok=True)
    for gate in "ABCD":
        (target / report_path(gate)).write_bytes(report_bytes(judge(target, gate)))
    admitted = admit("card", target)
    (target / "artifacts" / "card").mkdir(parents=True, exist_ok=True)
    card = card_bytes(draft(target, admitted.reports, admitted.hashes))
    (target / "artifacts" / "card" / "card.json").write_bytes(card)
    evidence.record(target)
    (target / "cards").mkdir(exist_ok=True)
    team = Team(target)
    today = datetime.datetime.now(datetime.UTC).date()
    days = {"not_before": str(today), "expires": str(today + datetime.timedelta(days=20))}
    team.sign(team.complete(**days), SIGNERS)
    shutil.move(team.folder, target / KEYS)
    as_stage(target)
    (target / ".dvc").mkdir()
    (target / ".dvc" / "config").write_text("[core]\n    no_scm = True\n    analytics = false\n")
    (target / "SYNTHETIC").touch()
    return settled(target, "gate_e")


def as_stage(workspace: Path) -> None:
    """Let `dvc repro` judge gate E of synthetic evidence, always, by the product's command."""
    path = workspace / "dvc.yaml"
    pipeline = json.loads(path.read_text())
    pipeline["stages"]["gate_e"] |= {
        "cmd": "python -m genpolicy gates judge E", "always_changed": True,
    }  # fmt: skip
    path.write_text(json.dumps(pipeline))


BASES: dict[str, str] = {
    "small": "through all gates, waiting for a person",
    "brought": "gate A on recordings of one's own",
    "signed": "synthetic evidence and a signed card",
}


def honest(workspace: Path, base: str) -> bool:
    """Whether a base is as it has to be: nothing of it is stopped."""
    return not look(workspace, base).stops and not verified(workspace, base)
