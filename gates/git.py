"""What git says of a checkout."""

import os
import subprocess
from pathlib import Path


def git(root: Path, *args: str) -> str | None:
    """Output of a git command, without space around it; None if it fails or there is no git."""
    command = ["git", "--no-replace-objects", "-C", str(root), *args]
    whole = {**os.environ, "GIT_GRAFT_FILE": os.devnull}  # or a file of ours could hide commits
    try:
        done = subprocess.run(
            command, capture_output=True, text=True, check=False, errors="replace", env=whole
        )
    except OSError:
        return None
    return done.stdout.strip() if done.returncode == 0 else None
