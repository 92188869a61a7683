"""Is a candidate there, and does it take and give what its entry says? Asked before all.

What loads a program or a checkpoint is a child, as when it is judged: nothing of it, and no runtime
of it, comes into the process that asks. It is loaded and not run. Of a policy of LeRobot the config
is read; a server that runs already is called, and asked nothing.
"""

import subprocess
from pathlib import Path

from genpolicy.candidates.hosts.kinds import LeRobotEntry, ProgramEntry, TrainedEntry
from genpolicy.candidates.hosts.lerobot_shapes import require_shapes
from genpolicy.candidates.hosts.translation import loading_command
from genpolicy.candidates.wire.connection import dial
from genpolicy.candidates.wire.entry import Entry, ServerEntry
from genpolicy.candidates.wire.faults import PolicyError
from genpolicy.contract.observation import ObservationContract
from genpolicy.errors import ConfigError

SAYS = "genpolicy serve-candidate: "
"""What the sentence of a refusal begins with."""
SILENT = "nothing"


def require_loadable(entry: Entry, path: Path, contract: ObservationContract) -> None:
    """Refuse what its host does not load, or what is of other names and shapes than its entry.

    A scripted function is not asked, since to load it is to run it; LeRobot's code and servers are
    started by nobody before they are judged.

    Args:
        entry: What it is; its files are verified.
        path: Its file.
        contract: The observation in force.

    Raises:
        ConfigError: One that does not load, or not within its `start_timeout_s`, or whose config
            says otherwise.
    """
    if isinstance(entry, LeRobotEntry):
        require_shapes(entry, path.resolve().parent, contract)
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
            expected=f"what a candidate of kind {entry.kind} is, as its entry says it",
            action="Correct the entry, or export it anew and write its hash into `files`.",
        )


def require_answering(entry: Entry, path: Path) -> None:
    """Refuse a server that runs already and does not answer the call; it is asked nothing.

    It is called as when it is judged, with as much patience (`timeout_s`), and hung up on.

    Raises:
        ConfigError: Nobody answers at its `address`, or nobody who speaks the protocol.
    """
    if not isinstance(entry, ServerEntry) or entry.address is None:
        return
    try:
        dial(entry.address, allowed=entry.allow_host, timeout_s=entry.timeout_s).close()
    except PolicyError as fault:
        raise ConfigError(
            where=f"{path}: address",
            found=f"{entry.address}, where no policy answers ({fault.seen})",
            expected="a policy that runs already: nobody here starts one that names no `command`",
            action="Start it and run this again, or name its `command`.",
        ) from fault


def _last(said: bytes) -> str:
    """The sentence of the refusal, or the last line of whatever else it died of."""
    lines = said.decode(errors="replace").strip().splitlines() or [SILENT]
    own = [line.removeprefix(SAYS) for line in lines if line.startswith(SAYS)]
    return (own or lines)[-1]
