"""`dvc metrics diff` shows a verdict that turned: verdicts are metrics, in a real repository."""

import json
import os
import subprocess
import sys
from pathlib import Path
from typing import Any

import pytest
import yaml

from gates.proof import judge
from stages._gate import _metrics

ROOT = Path(__file__).parents[2]
OWN = {"GIT_AUTHOR_NAME": "a", "GIT_AUTHOR_EMAIL": "a@b.c", "GIT_COMMITTER_NAME": "a",
       "GIT_COMMITTER_EMAIL": "a@b.c", "GIT_CONFIG_GLOBAL": os.devnull,
       "DVC_NO_ANALYTICS": "1"}  # fmt: skip


@pytest.fixture
def repository(tmp_path: Path) -> Path:
    """A git repository with DVC, and of the project's `dvc.yaml` the metrics of its gates."""
    root = tmp_path / "repo"
    (root / "reports").mkdir(parents=True)
    project = yaml.safe_load((ROOT / "dvc.yaml").read_text())["stages"]
    stages = {
        name: {"cmd": "true", "metrics": stage["metrics"]}
        for name, stage in project.items()
        if name.startswith("gate_")
    }
    assert len(stages) == 5 and all(len(stage["metrics"]) == 1 for stage in stages.values())
    (root / "dvc.yaml").write_text(yaml.safe_dump({"stages": stages}))
    _run(root, "git", "init", "-q", "-b", "main")
    _run(root, sys.executable, "-m", "dvc", "init", "-q")
    return root


def _run(root: Path, *command: str) -> str:
    done = subprocess.run(
        command, cwd=root, env={**os.environ, **OWN}, capture_output=True, text=True, check=False
    )
    assert done.returncode == 0, (command, done.stdout, done.stderr)
    return done.stdout


def test_a_verdict_that_turns_is_a_metric_that_changes(
    repository: Path, gate_evidence: Any, tmp_path: Path
) -> None:
    evidence = tmp_path / "evidence"
    evidence.mkdir()
    gate_evidence.build(evidence)
    path = repository / "reports" / "gate_b.metrics.json"
    path.write_text(json.dumps(_metrics(judge(evidence, "B"))))
    _run(repository, "git", "add", "-A")
    _run(repository, "git", "commit", "-q", "-m", "passes")
    gate_evidence.edit_table(
        evidence, "reload/nfe.parquet", lambda rows: rows.assign(recorded=rows["recorded"] + 1)
    )
    report = judge(evidence, "B")
    assert report.verdict == "FAIL"
    path.write_text(json.dumps(_metrics(report)))
    said = _run(repository, sys.executable, "-m", "dvc", "metrics", "diff", "--json")
    found = json.loads(said)["reports/gate_b.metrics.json"]
    assert found["verdict"] == {"old": "PASS", "new": "FAIL"}
    assert found["passes"] == {"old": 1, "new": 0, "diff": -1}
    assert found["candidates.flow"] == {"old": "PASS", "new": "FAIL"}
    turned = {name: change for name, change in found.items() if name.endswith(".verdict")}
    assert turned["criteria.flow.nfe_mismatch.verdict"] == {"old": "PASS", "new": "FAIL"}
    table = _run(repository, sys.executable, "-m", "dvc", "metrics", "diff", "--md")
    assert "| reports/gate_b.metrics.json | verdict" in " ".join(table.split())
