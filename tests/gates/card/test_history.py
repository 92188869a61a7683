"""What came first, and who committed: asked of a small repository."""

import subprocess

import pytest
import yaml

from gates.card.history import require_no_commit_of, require_registered_first
from gates.card.people import Person
from genpolicy.errors import IntegrityError

PLAN, LOCK = "preregistration.yaml", "dvc.lock"


@pytest.fixture
def history(tmp_path):
    def git(*args):
        subprocess.run(["git", "-C", str(tmp_path), *args], check=True, capture_output=True)

    def commit(author="ada", **files):
        for name, text in files.items():
            (tmp_path / {"plan": PLAN, "lock": LOCK, "params": "params.yaml"}[name]).write_text(
                text
            )
        git("add", "-A")
        mail = f"{author}@example.org"
        git("-c", f"user.name={author}", "-c", f"user.email={mail}", "commit", "-q", "-m", "x")

    git("init", "-q")
    return tmp_path, commit


def _lock(digest):
    outs = [{"path": "artifacts/stress", "md5": digest}]
    return yaml.safe_dump({"stages": {"stress": {"outs": outs}}})


def test_a_plan_before_the_evidence_is_one(history):
    root, commit = history
    commit(plan="a: 1")
    commit(lock=_lock("0123456789abcdef.dir"))
    require_registered_first(root)
    commit(params="later: 1")
    require_registered_first(root)


@pytest.mark.parametrize("order", ["after", "together", "moved after", "edited", "uncommitted"])
def test_a_plan_that_came_with_or_after_the_evidence_is_none(history, order):
    root, commit = history
    lock = _lock("0123456789abcdef.dir")
    if order == "after":
        commit(lock=lock)
        commit(plan="a: 1")
    elif order == "together":
        commit(lock=lock, plan="a: 1")
    else:
        commit(plan="a: 1")
        if order == "uncommitted":
            (root / LOCK).write_text(lock)
        else:
            commit(lock=lock)
        if order == "moved after":
            commit(plan="a: 2")
        elif order == "edited":
            (root / PLAN).write_text("a: 3")
    with pytest.raises(IntegrityError, match="committed"):
        require_registered_first(root)


def test_an_untracked_plan_is_none(history):
    root, commit = history
    commit(lock=_lock("0123456789abcdef.dir"))
    (root / PLAN).write_text("a: 1")
    with pytest.raises(IntegrityError, match="not committed"):
        require_registered_first(root)


def test_without_git_nothing_came_first(tmp_path):
    with pytest.raises(IntegrityError, match="without git"):
        require_registered_first(tmp_path)
    with pytest.raises(IntegrityError, match="without git"):
        require_no_commit_of(tmp_path, _person(["rita@example.org"]))


def test_where_git_is_not_installed_nothing_came_first(history, monkeypatch):
    root, commit = history
    commit(plan="a: 1")
    monkeypatch.setenv("PATH", str(root))
    with pytest.raises(IntegrityError, match="without git"):
        require_registered_first(root)


@pytest.mark.parametrize("text", ["stages: {}", "stages: {stress: {}}", "[1]", "stages: [1]"])
def test_a_lock_without_the_comparison_records_no_evidence(history, text):
    root, commit = history
    commit(plan="a: 1")
    commit(lock=text)
    with pytest.raises(IntegrityError, match="artifacts/stress is not committed"):
        require_registered_first(root)


def test_only_the_evidence_of_the_comparison_dates_it(history):
    """Another output of the stage, older than the plan, is no evidence of it."""
    root, commit = history
    other = {"path": "artifacts/other", "md5": "fedcba9876543210.dir"}
    own = {"path": "artifacts/stress", "md5": "0123456789abcdef.dir"}
    commit(lock=yaml.safe_dump({"stages": {"stress": {"outs": [other]}}}))
    commit(plan="a: 1")
    commit(lock=yaml.safe_dump({"stages": {"stress": {"outs": [other, own]}}}))
    require_registered_first(root)


def _person(emails, role="reviewer"):
    return Person(id="rita", name="R", role=role, public_key="0" * 64, emails=tuple(emails))


def test_a_reviewer_committed_nothing_of_the_candidate(history):
    root, commit = history
    commit("ada", params="a: 1")
    commit("rita", plan="a: 1")
    require_no_commit_of(root, _person(["rita@example.org"]))
    with pytest.raises(IntegrityError, match="without addresses"):
        require_no_commit_of(root, _person([]))
    commit("rita", params="a: 2")
    with pytest.raises(IntegrityError, match="committed to the candidate"):
        require_no_commit_of(root, _person(["other@example.org", "Rita@Example.org".lower()]))
    require_no_commit_of(root, _person(["rita@example.org"], role="safety"))
