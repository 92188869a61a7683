"""Plain behaviour cloning and an energy go the whole way that they can: timed, shadowed, stressed.

They are candidates as any other where `params.yaml` names them so; by default they stand at Gate A
alone. With them goes a policy in a process of its own, as somebody else would bring it: the flow
that the finished ladder trained. What follows Gate A runs again with these three, and the
independent proof draws their chunks again.
"""

import json
import subprocess
import sys
from pathlib import Path
from typing import Any

import pandas as pd
import pytest
from brought import NAME, bring_flow
from ladder_workspace import edit_params, flip_a_bit, repro

from flows.reproduce import stage_environment
from genpolicy.policies.energy import EnergyNetwork
from genpolicy.policies.policy import load_policy

STEPS, POPULATION = 4, 16
ADDED = {
    "ibc": {"name": "langevin", "steps": STEPS, "population": POPULATION},
    "bc": {"name": "direct"},
}
BEHIND_GATE_A = [
    "train_generators", "reload", "latency", "gate_b", "shadow", "gate_c", "wall_clock",
    "stress", "monitors", "gate_d", "failure_search", "card", "gate_e",
]  # fmt: skip


def once(monitors: dict[str, Any]) -> None:
    """Each kind of rollout once; the finished ladder has all families of probes."""
    monitors["threshold_starts"] = 1
    monitors["probes"] = {"lighting": monitors["probes"]["lighting"]}


def methods(workspace: Path, table: str) -> set[str]:
    return set(pd.read_parquet(workspace / "artifacts" / table)["method"])


@pytest.mark.long
def test_ibc_plain_bc_and_a_policy_of_somebody_else_as_candidates(copy: Path) -> None:
    bring_flow(copy)

    def add(params: dict[str, Any]) -> None:
        params["compute"]["workers"] = 1  # the finished ladder had two
        params["train_generators"]["samplers"] = ADDED  # the others' way: the finished ladder
        params["stress"]["starts"] = 1
        params["card"]["failure_search"]["evaluations"] = 1
        once(params["monitors"])

    edit_params(copy, add)
    outcome, ran = repro(copy)
    # The task reads who is brought before anything trains, so Gate A is judged again: in seconds.
    assert (outcome.code, ran) == (0, ["gate_a", *BEHIND_GATE_A]), outcome.sentence
    for table in (
        "latency/latency.parquet", "shadow/candidates.parquet", "stress/rollouts.parquet",
        "stress/overruns.parquet",
    ):  # fmt: skip
        assert "ibc" in methods(copy, table), table
        # One action is over when it comes, so that nothing of it reaches the stub: not admitted.
        assert ("bc" in methods(copy, table)) == (not table.startswith("stress")), table
    report = json.loads((copy / "reports" / "gate_c.json").read_text())
    assert (report["candidates"]["ibc"], report["candidates"]["bc"]) == ("PASS", "INCONCLUSIVE")
    nfe = pd.read_parquet(copy / "artifacts/reload/nfe.parquet").set_index("method")
    # Every move scores all candidates once, and the last ones are scored once more.
    for method, evaluations in (("ibc", STEPS + 1), ("bc", 1)):
        row = nfe.loc[method]
        assert row["recorded"] == row["counted"] == row["expected"] == evaluations
    folder = copy / "artifacts/train_generators/ibc/seed_0"
    assert isinstance(load_policy(folder).checkpoint.network, EnergyNetwork)
    samples = pd.read_parquet(copy / "artifacts/reload/samples.parquet")
    own = samples[samples["method"].isin(list(ADDED))]
    assert (own["sha256_trained"] == own["sha256_reloaded"]).all() and len(own) > 0
    brought_went_the_same_way(copy)
    assert proved(copy) == {**dict.fromkeys("ABCD", "PASS"), "E": "PENDING_REVIEW"}
    other_weights_stop_the_ladder_before_anything_runs(copy)


def brought_went_the_same_way(copy: Path) -> None:
    """It is measured in every table, judged by every gate, and said to be unmatched."""
    for table in (
        "reload/modes.parquet", "reload/coverage.parquet", "latency/latency.parquet",
        "latency/candidates.parquet", "shadow/candidates.parquet", "stress/rollouts.parquet",
    ):  # fmt: skip
        assert NAME in methods(copy, table), table
    samples = pd.read_parquet(copy / "artifacts/reload/samples.parquet")
    own = samples[samples["method"] == NAME]
    assert len(own) > 0 and (own["sha256_trained"] == own["sha256_reloaded"]).all()
    for gate in "bcd":
        report = json.loads((copy / "reports" / f"gate_{gate}.json").read_text())
        assert report["candidates"][NAME] == "PASS", (gate, report["candidates"])
        unmatched = [text for text in report["caveats"] if f"{NAME} is unmatched" in text]
        assert bool(unmatched) == (gate != "c")


def other_weights_stop_the_ladder_before_anything_runs(copy: Path) -> None:
    """Weights that changed behind Gate B: what was measured is of others."""
    flip_a_bit(copy / "own/flow/seed_0/model.safetensors")
    outcome, ran = repro(copy)
    assert (outcome.code, ran) == (2, [])
    assert NAME in outcome.sentence and "model.safetensors" in outcome.sentence


def proved(workspace: Path) -> dict[str, str]:
    """What `genpolicy verify report` says of each gate, its journals drawn again."""
    done = subprocess.run(
        [sys.executable, "-m", "genpolicy", "verify", "report"],
        cwd=workspace,
        env=stage_environment(workspace),
        capture_output=True,
        text=True,
        check=False,
    )
    lines = [line.split() for line in done.stdout.splitlines() if line[:1] in "ABCDE"]
    return {
        line[0]: next(word for word in line if word.isupper() and len(word) > 1) for line in lines
    }
