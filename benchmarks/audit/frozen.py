"""Report seeds are drawn after the detector is frozen: their root is the hash of the commit.

Whoever changes the detector after seeing its errors draws other data sets. So a report is run only
where everything that decides a verdict is as it was committed.
"""

import subprocess
from collections.abc import Sequence
from pathlib import Path

from genpolicy.errors import BadInputError

ROOT = Path(__file__).parents[2]
DETECTOR = ("genpolicy", "gates", "benchmarks/audit", "params.yaml", "constraints.txt")
# Development seeds lie below.
FIRST_REPORT_SEED = 10**9
DIGITS = 12


def frozen_commit(root: Path = ROOT, watched: Sequence[str] = DETECTOR) -> str:
    """The commit whose detector stands in the working tree; `watched` must be as committed.

    Raises:
        BadInputError: No repository, or a file of the detector is not as committed.
    """
    changed = _git(root, "status", "--porcelain", "--untracked-files=all", "--", *watched)
    if changed:
        raise BadInputError(
            where="the working tree",
            found=f"changed: {changed.splitlines()[0].strip()}",
            expected="the detector as committed",
            action="Commit the detector first; its hash is the root of the report's seeds.",
        )
    return _git(root, "rev-parse", "HEAD")


def report_seed(commit: str) -> int:
    """First seed of the report of a commit, above every development seed."""
    return FIRST_REPORT_SEED + int(commit[:DIGITS], 16)


def _git(root: Path, *command: str) -> str:
    try:
        done = subprocess.run(
            ["git", "-C", str(root), *command], capture_output=True, text=True, check=True
        )
    except (OSError, subprocess.CalledProcessError) as error:
        raise BadInputError(
            where=str(root),
            found=f"git {command[0]} failed",
            expected="a repository with a commit",
            action="Run the report inside the repository.",
        ) from error
    return done.stdout.strip()
