"""Can a program or a checkpoint be loaded, and does it take what its entry says? Asked before all.

What loads it is a child, as when it is judged: nothing of it, and no runtime of it, comes into the
process that asks. It is loaded and not run.
"""

import subprocess
from pathlib import Path

from genpolicy.candidates.hosts.kinds import ProgramEntry, TrainedEntry
from genpolicy.candidates.hosts.translation import loading_command
from genpolicy.candidates.wire.entry import Entry
from genpolicy.contract.observation import ObservationContract
from genpolicy.errors import ConfigError

SAYS = "genpolicy serve-candidate: "
"""What the sentence of a refusal begins with."""
SILENT = "nothing"


def require_loadable(entry: Entry, path: Path, contract: ObservationContract) -> None:
    """Refuse a program or checkpoint that its host does not load, or of other names and shapes.

    A scripted function is not asked, since to load it is to run it; LeRobot's code and servers are
    started by nobody before they are judged.

    Args:
        entry: What it is; its files are verified.
        path: Its file.
        contract: The observation in force.

    Raises:
        ConfigError: One that does not load, or not within its `start_timeout_s`.
    """
    if not isinstance(entry, ProgramEntry | TrainedEntry):
        return
    try:
        done = subprocess.run(
            loading_command(entry, path, contract), cwd=path.resolve().parent,
            stdin=subprocess.DEVNULL, capture_output=True, timeout=entry.start_timeout_s,
            check=False,
        )  # fmt: skip
    except subprocess.TimeoutExpired as error:
        raise ConfigError(
            where=f"{path}: start_timeout_s",
            found=f"{entry.start_timeout_s:g} s, in which it was not loaded",
            expected="enough to load it",
            action="Allow it more, up to 600 s, or bring a smaller one.",
        ) from error
    if done.returncode != 0:
        raise ConfigError(
            where=f"{path}: the candidate {entry.name}",
            found=f"refused by its host ({_last(done.stderr)})",
            expected=f"what a candidate of kind {entry.kind} is, of the inputs that its entry says",
            action="Correct the entry, or export it anew and write its hash into `files`.",
        )


def _last(said: bytes) -> str:
    """The sentence of the refusal, or the last line of whatever else it died of."""
    lines = said.decode(errors="replace").strip().splitlines() or [SILENT]
    own = [line.removeprefix(SAYS) for line in lines if line.startswith(SAYS)]
    return (own or lines)[-1]
