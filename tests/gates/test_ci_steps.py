"""The steps that `docs/ci` has teams copy, run as the service runs them."""

import os
import subprocess
import sys

import pytest
import yaml
from test_differences import REPORT

from gates.report import SCHEMA_VERSION, report_bytes

GITHUB = "docs/ci/github.yml"
GOOD = REPORT.model_copy(update={"schema_version": SCHEMA_VERSION})


def step(root, named):
    """Shell text of the step of that name."""
    jobs = yaml.safe_load((root / GITHUB).read_text())["jobs"]
    [found] = [s for s in jobs["gates"]["steps"] if named in s.get("name", "")]
    return found["run"]


@pytest.fixture
def branch(tmp_path, request):
    """A checkout whose base branch has no reports, with those of a ladder in the working tree."""

    def git(*words):
        who = ("-c", "user.name=a", "-c", "user.email=a@example.org")
        subprocess.run(["git", "-C", str(tmp_path), *who, *words], check=True)

    git("init", "-q")
    git("commit", "-qm", "nothing yet", "--allow-empty")
    git("update-ref", "refs/remotes/origin/main", "HEAD")
    (tmp_path / "reports").mkdir()
    (tmp_path / "reports/gate_a.json").write_bytes(report_bytes(GOOD))
    (tmp_path / "reports/gate_a.md").write_text("# What gate A says\n")
    program = tmp_path / ".venv/bin/genpolicy"
    program.parent.mkdir(parents=True)
    program.write_text(f'#!/bin/sh\nexec {sys.executable} -m genpolicy "$@"\n')
    program.chmod(0o755)

    def run(text):
        summary = tmp_path / "summary.md"
        found = {
            **os.environ, "GITHUB_BASE_REF": "main", "GITHUB_STEP_SUMMARY": str(summary),
            "PYTHONPATH": str(request.config.rootpath),
        }  # fmt: skip
        (tmp_path / "step.sh").write_text(text)
        done = subprocess.run(["bash", "-e", "step.sh"], cwd=tmp_path, env=found, check=False)
        return done.returncode, summary.read_text()

    return run, git


def test_a_branch_without_reports_to_compare_with_makes_no_job_red(branch, request):
    run, git = branch
    text = step(request.config.rootpath, "what moved")
    code, said = run(text)
    assert code == 0
    assert said.startswith("# What gate A says") and said.rstrip().endswith("```")
    assert "origin/main is without a report of a gate" in said and "No difference is shown" in said
    git("add", "reports")
    git("commit", "-qm", "reports")
    git("update-ref", "refs/remotes/origin/main", "HEAD")
    code, said = run(text)
    assert code == 0 and said.count("No difference is shown") == 1
