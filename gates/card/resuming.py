"""After a signature: the run of gate E that waits for the card is told that it may be there.

The gates know no Prefect, and no verdict depends on a server. So nothing is resumed here: where a
run may wait, `genpolicy resume` is run as a person would run it, which verifies the card first and
leaves the run suspended if it is wrong. Whatever comes of it, the signature stands.
"""

import os
import subprocess
import sys
from pathlib import Path

from gates.proof import judge
from genpolicy.errors import GenpolicyError

HOME, ADDRESS = ".prefect", "PREFECT_API_URL"
RESUME = ("resume", "--if-waiting", "--workspace")


def may_wait(root: Path) -> bool:
    """Whether a run of gate E may wait: a server is named, or the ladder ran here with its own."""
    return bool(os.environ.get(ADDRESS)) or (root / HOME).is_dir()


def go_on(root: Path) -> None:
    """With a card that passes gate E, resume the run that waits for it, if one does.

    Says so, and fails never: the signature stands.
    """
    if not may_wait(root):
        return
    try:
        if judge(root, "E").verdict != "PASS":
            return
    except GenpolicyError as error:
        print(f"The signature stands. Gate E cannot be judged yet: {error}")
        return
    print("The card is complete. Looking for a run of gate E that waits for it ...", flush=True)
    command = [sys.executable, "-m", "genpolicy", *RESUME, str(root)]
    try:
        code = subprocess.run(command, stdin=subprocess.DEVNULL, check=False).returncode
    except OSError:
        code = 1
    if code:
        print("It was not gone on with. The signature stands; try: genpolicy resume")
