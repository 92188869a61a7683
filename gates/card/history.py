"""What only the history of the repository knows: what came first, and who committed.

Asked by the commands `sign` and `verify card`, not by the judge: the same evidence gives the same
report, whatever is committed afterwards.
"""

import subprocess
from pathlib import Path

from gates.card.people import REVIEWER, Person
from gates.preregistration import PREREGISTRATION
from genpolicy.errors import IntegrityError
from genpolicy.integrity.documents import read_yaml

LOCK = "dvc.lock"
EVIDENCE = "artifacts/stress"
CANDIDATE = ("genpolicy", "gates", "stages", "params.yaml", "dvc.yaml")
"""Whoever committed to these made the candidate, or the yardstick that it is held against."""


def require_registered_first(root: Path) -> None:
    """Require that the plan was committed before the evidence, and not touched since.

    Raises:
        IntegrityError: No git repository, the plan or the evidence is not committed, or the plan
            is no older than the evidence.
    """
    if _git(root, "rev-parse", "--git-dir") is None:
        _refuse("the repository", "without git history", "a plan committed before the evidence")
    if _git(root, "diff", "--quiet", "HEAD", "--", PREREGISTRATION) is None:
        _refuse(PREREGISTRATION, "not committed as it lies here", "committed before the evidence")
    planned = _git(root, "log", "-1", "--format=%H", "--", PREREGISTRATION)
    if not planned:
        _refuse(PREREGISTRATION, "not committed", "committed before the evidence")
    digest = _evidence_digest(root)
    commits = _git(root, "log", "--reverse", "--format=%H", f"-S{digest}", "--", LOCK) or ""
    if not digest or not commits:
        _refuse(f"{LOCK}: {EVIDENCE}", "not committed", "committed after the plan")
    first = commits.split()[0]
    ancestor = _git(root, "merge-base", "--is-ancestor", str(planned), first) is not None
    if first == planned or not ancestor:
        _refuse(PREREGISTRATION, "no older than the evidence", "committed before the evidence")


def require_no_commit_of(root: Path, person: Person) -> None:
    """Require of a reviewer that no commit of what makes the candidate is theirs.

    Raises:
        IntegrityError: No git repository, no address of the reviewer, or a commit under one.
    """
    if person.role != REVIEWER:
        return
    found = _git(root, "log", "--format=%ae", "--", *CANDIDATE)
    if found is None:
        _refuse("the repository", "without git history", "one that says who made the candidate")
    if not person.emails:
        _refuse(f"the reviewer {person.id}", "without addresses", "those of their commits")
    own = {mail.casefold() for mail in person.emails}
    committed = sorted(own & {mail.casefold() for mail in str(found).split()})
    if committed:
        text = f"who committed to the candidate as {committed[0]}"
        _refuse(f"the reviewer {person.id}", text, "a reviewer who did not make it")


def _evidence_digest(root: Path) -> str:
    """Hash of the comparison's evidence, as the lock file records it; empty without."""
    lock = read_yaml(root / LOCK)
    stages = lock.get("stages") if isinstance(lock, dict) else None
    stage = stages.get("stress") if isinstance(stages, dict) else None
    for out in (stage.get("outs") or ()) if isinstance(stage, dict) else ():
        if isinstance(out, dict) and out.get("path") == EVIDENCE:
            return str(out.get("md5") or "")
    return ""


def _git(root: Path, *args: str) -> str | None:
    """Output of a git command; None if it fails or there is no git."""
    try:
        done = subprocess.run(
            ["git", "-C", str(root), *args], capture_output=True, text=True, check=False
        )
    except OSError:
        return None
    return done.stdout.strip() if done.returncode == 0 else None


def _refuse(where: str, found: str, expected: str) -> None:
    raise IntegrityError(
        where=where,
        found=found,
        expected=expected,
        action="Plan, commit, run, commit, and have it reviewed by somebody else; then sign.",
    )
