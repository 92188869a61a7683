"""The whole report of Gate A, of even evidence, of uneven, and of evidence that says little."""

from pathlib import Path
from typing import Any

import evidence
import numpy as np
import pandas as pd
from as_told import hold, told
from drawn import hold_pictures

from gates.proof import judge


def test_gate_a_of_even_evidence_says_what_it_said(ladder):
    hold("gate_a", told(judge(ladder, "A")))


def test_gate_a_of_uneven_evidence_says_what_it_said(ladder):
    mixed_need(ladder)
    hold("gate_a_uneven", told(judge(ladder, "A")))


def test_gate_a_of_uneven_evidence_draws_what_it_drew(ladder):
    mixed_need(ladder)
    hold_pictures("gate_a_drawn", "A", ladder, judge(ladder, "A"))


def test_gate_a_of_evidence_that_says_little_says_what_it_said(ladder):
    thin_need(ladder)
    hold("gate_a_thin", told(judge(ladder, "A")))


def mixed_need(root: Path) -> None:
    """Gate A where no share is nought or one, so that each number is that of its own rows."""

    def sampled(frame: pd.DataFrame) -> pd.DataFrame:
        i, kind = frame["index"], frame.groupby("convention", sort=False).ngroup()
        passed = (5 * i + 3 * kind) % 17
        valid = np.minimum(passed, (i + kind) % 7)
        return frame.assign(
            modes_present=np.where(i % 4 == 0, 1, 2 + (i % 5 == 0)), admissible=passed,
            valid=valid, modes_valid=np.minimum(valid, 1 + (i % 3 == 0)), modes_covered=i % 3,
        )  # fmt: skip

    edit = evidence.edit_table
    edit(root, "measure_baselines/modes.parquet", sampled)
    edit(root, "measure_factors/modes.parquet", lambda f: sampled(f).assign(
        admissible=np.where(f["index"] % 3 > 0, 16, 4)))  # fmt: skip
    edit(root, "audit/neighbourhoods.parquet", lambda f: f.assign(
        two_mode=f["index"] % 5 > 0, modes_admissible=1 + (f["index"] % 7 > 0),
        median_admissible=f["index"] % 3 == 1, mean_admissible=f["index"] % 11 == 0,
        episode_uuid=[f"e{i // 2}" for i in f["index"]]))  # fmt: skip
    edit(root, "audit/replay.parquet", lambda f: f.assign(
        replayed=np.where(f.index < 2, "failure", "success")))  # fmt: skip
    edit(root, "audit/strata.parquet", lambda f: f.assign(
        p_adjusted=[0.001, 0.002, 0.9], effect=[0.22, 0.7, 0.1], effect_lower=[0.15, 0.02, 0.0],
        effect_upper=[0.3, 0.9, 0.3], detail=["by hand", "", ""], observed=[True, False, False],
    ))  # fmt: skip
    edit(root, "audit/predictions.parquet", lambda f: f.assign(
        told=[0.2, 0.1], told_lower=[0.05, -0.1], told_upper=[0.35, 0.3], n=[120, 90]))  # fmt: skip
    edit(root, "audit/recovery.parquet", lambda f: pd.concat([f, f.assign(successes=[7, 9])]))
    edit(root, "audit/clocks.parquet", lambda f: f.assign(
        offset_after_s=[0.001, -0.004, 0.002, 0.003], lag_rows=[2.0, 2.5, 4.0, 4.25]))  # fmt: skip
    edit(root, "audit/findings.parquet", lambda _: evidence.finding("gain_factor", 1.05))
    edit(root, "audit/asked.parquet", lambda f: f.assign(
        asked=[True, False, True], reason=["", "no lag is constant", ""]))  # fmt: skip
    evidence.edit_document(root, "measure_baselines/latent.json", lambda d: [
        {**d[0], "exceeding": 7}, {**d[0], "convention": "z_zero", "exceeding": 12}])  # fmt: skip
    evidence.edit_document(root, "audit/summary.json", lambda d: {**d, "modes_with_phase": 35})
    evidence.edit_document(root, "train_baselines/matched.json", _differs_more)
    evidence.edit_document(root, "train_factors/variants.json", _changes_more)
    waived = {"model": {"constant_lag": "it never is", "labels": "none are read"}}
    evidence.write_params(root, lambda p: p["gate_a"].update(waived_checks=waived))


def _differs_more(document: dict[str, Any]) -> None:
    document["differing_keys"]["act"] = ["head", "steps", "rate"]


def _changes_more(document: dict[str, Any]) -> None:
    document["variants"]["transformer"]["changed"] = ["network.trunk", "method"]


def thin_need(root: Path) -> None:
    """Gate A where most cannot be told: unasked, undecided, unknown, untried."""
    evidence.edit_table(root, "audit/asked.parquet", lambda f: f.assign(
        asked=[True, False, False], reason=["", "no lag is constant", "nobody wrote it down"],
    ))  # fmt: skip
    evidence.edit_table(root, "audit/predictions.parquet", lambda f: f.assign(
        told=0.45, told_lower=0.3, told_upper=[0.5, 0.6]))  # fmt: skip
    evidence.edit_document(root, "audit/persistence.json", lambda d: {**d, "n": 9})
    evidence.edit_document(root, "measure_baselines/latent.json", lambda d: [
        {**d[0], "exceeding": 300}])  # fmt: skip
    for name in ("audit/calibration.parquet", "audit/recovery.parquet"):
        evidence.replace(root, name, None)
    evidence.edit_table(
        root, "measure_baselines/modes.parquet", lambda f: f[f["method"] != "one_mode_bc"]
    )
    evidence.edit_table(
        root, "measure_factors/modes.parquet", lambda f: f[f["variant"] != "transformer"]
    )
    evidence.edit_document(root, "audit/summary.json", lambda d: {
        **d, "modes_with_phase": 0, "modes_without_phase": 0})  # fmt: skip
