"""What a late stage would refuse at once is refused before the first one runs."""

import subprocess
import sys
from pathlib import Path

from genpolicy.errors import BadInputError
from genpolicy.outputs import PIPELINE

ASKED = "stages._beforehand"
REFUSES = BadInputError.exit_code
"""Any other end says nothing of the input; the stages ask again."""
FIRST = "Nothing has run. `genpolicy reproduce gate_a` runs what comes before."


def refused_beforehand(workspace: Path) -> str:
    """Why a run of the whole ladder would end late, as its stage would say it; empty if it may run.

    In a process of its own, since stages are of no import of the flows.

    Args:
        workspace: Folder of the pipeline; one without stages of ours is not asked.
    """
    if not (workspace / PIPELINE).is_file():
        return ""
    command = [sys.executable, "-m", ASKED]
    end = subprocess.run(command, cwd=workspace, check=False, capture_output=True, text=True)
    return f"{end.stderr.strip()} {FIRST}" if end.returncode == REFUSES else ""
