"""What a gate's report says, whole: worlds of synthetic evidence and their golden reports.

Made by the code of decision 156; next steps and mixed rows were read then, not every row. After a
change that is meant: `PYTHONPATH=. python tests/gates/golden_reports.py`, and read the difference.
"""

import json
import shutil
import sys
import tempfile
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd

if __name__ == "__main__":
    sys.path.insert(0, str(Path(__file__).parent))

import evidence

from gates.proof import judge
from gates.report import GateReport

FOLDER = Path(__file__).parent / "golden"
Change = Callable[[Path], None]


def said(report: GateReport) -> dict[str, Any]:
    """All that the report says to a person, numbers to nine digits."""
    return {
        "verdict": report.verdict, "diagnosis": report.diagnosis, "decision": report.decision,
        "promoted": report.promoted, "candidates": report.candidates,
        "caveats": list(report.caveats), "materials": sorted(report.materials),
        "criteria": [
            [c.id, c.candidate, c.verdict, _plain(c.measured), c.interval and
             [_plain(end) for end in c.interval], c.comparison, _plain(c.threshold), c.caveat,
             list(c.evidence)]
            for c in report.criteria
        ],
    }  # fmt: skip


def _plain(value: float | None) -> float | None:
    return None if value is None else float(f"{value:.9g}")


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
        offset_after_s=[0.001, -0.004, 0.002, 0.003], lag_steps=[2.0, 2.5, 4.0, 4.25]))  # fmt: skip
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


WORLDS: dict[str, dict[str, Change]] = {
    "A": {"as it is": lambda root: None, "mixed": mixed_need, "thin": thin_need},
}


def reports(evidence_root: Path, scratch: Path, gate: str) -> dict[str, Any]:
    """What the gate says in each of its worlds."""
    found = {}
    for name, change in WORLDS[gate].items():
        root = scratch / name.replace(" ", "_")
        shutil.copytree(evidence_root, root)
        change(root)
        found[name] = said(judge(root, gate))
    return json.loads(json.dumps(found))


def golden(gate: str) -> Path:
    """The file of a gate's golden reports."""
    return FOLDER / f"gate_{gate.lower()}.json"


def _written(told: dict[str, Any]) -> str:
    """A line for each value of a list, so that a difference can be read."""
    worlds = [
        f" {_line(name)}: {{\n"
        + ",\n".join(f"  {_line(key)}: {_lines(value)}" for key, value in one.items())
        + "}"
        for name, one in told.items()
    ]
    return "{\n" + ",\n".join(worlds) + "}\n"


def _lines(value: object) -> str:
    several = isinstance(value, list) and len(value) > 1
    return "[\n   " + ",\n   ".join(map(_line, value)) + "]" if several else _line(value)


def _line(value: object) -> str:
    return json.dumps(value, ensure_ascii=False)


if __name__ == "__main__":
    for letter in WORLDS:
        with tempfile.TemporaryDirectory() as folder:
            built = Path(folder) / "built"
            built.mkdir()
            evidence.build(built)
            told = reports(built, Path(folder), letter)
        FOLDER.mkdir(exist_ok=True)
        golden(letter).write_text(_written(told))
