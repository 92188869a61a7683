"""From an entry of any kind to the server that hosts it: one command, in a child of its own."""

import sys
from pathlib import Path

from genpolicy.candidates.hosts.commands import module_files, require_known_words, words_of
from genpolicy.candidates.hosts.kinds import LeRobotEntry, ProgramEntry, TrainedEntry
from genpolicy.candidates.hosts.lerobot_shapes import require_shapes
from genpolicy.candidates.hosts.lerobot_steps import require_steps
from genpolicy.candidates.hosts.lerobot_words import require_words
from genpolicy.candidates.hosts.served_weights import require_served_weights
from genpolicy.candidates.wire.channels import columns_of, widths_of
from genpolicy.candidates.wire.entry import PORT, Entry, ServerEntry
from genpolicy.contract.observation import ObservationContract
from genpolicy.errors import ConfigError
from genpolicy.integrity.hashing import sha256_file

ROOT = Path(__file__).parents[3]
ADAPTER = ROOT / "adapters" / "lerobot_server.py"
HERE = (
    "import sys; at = [*map(lambda p: p.endswith('site-packages'), sys.path), True].index(True); "
    "sys.path[at:at] = [sys.argv.pop(1)]; "
    "from genpolicy.cli.main import main; sys.exit(main())"
)
"""Runs the code that asks: what is installed may be that of another checkout. It comes before what
is installed and behind Python's own modules, none of which a file beside ours may replace."""


def as_server(
    entry: Entry, path: Path, contract: ObservationContract, *, threads: int | None = None
) -> ServerEntry:
    """The entry of the server that hosts a candidate; a server is its own.

    Args:
        entry: What it is.
        path: Its file, which the child reads again and holds against this entry.
        contract: The observation in force, which says how wide its inputs are.
        threads: Of a program's operators, in place of those of its entry; None: those.

    Raises:
        ConfigError: Nothing on this machine runs it, or a checkpoint or policy of LeRobot takes or
            gives something else than it says, or has a config that may name a place or processors
            that could run code, or weights of a server are pinned by nothing.
        ContractError: It names what the observation does not have.
    """
    if isinstance(entry, ServerEntry):
        require_served_weights(entry, path.resolve().parent)
        require_known_words(entry, path.resolve().parent)
        return entry
    entry.require_host()
    common = {name: getattr(entry, name) for name in Entry.model_fields if name != "kind"}
    if isinstance(entry, LeRobotEntry):
        require_shapes(entry, path.resolve().parent, contract)
        require_words(entry, path.resolve().parent)
        require_steps(entry, path.resolve().parent)
        command = _lerobot(entry)
    else:
        command = _own(entry, path, contract)
    if threads is not None and isinstance(entry, ProgramEntry):
        command += ["--threads", str(threads)]
    return ServerEntry(**common, kind="server", command=command)


def program_files(entry: Entry, folder: Path) -> dict[str, str]:
    """What runs a candidate, beside the files that are it: SHA-256 by path.

    Our own host is none of it: every stage that starts one depends on its code. What an
    environment has installed, an interpreter among it, is none of it (see `installed_module`); nor
    is whatever a script or module imports or reads, unless it stands in `files`.

    Args:
        entry: What it is.
        folder: Of the entry's file.

    Returns:
        Of a LeRobot policy the adapter; of a server the files that words of its command name from
        the folder, as they are or behind `--x=`, and those that a module behind `-m` begins with;
        of a link its target. Empty of the others.

    Raises:
        IntegrityError: One cannot be read.
    """
    if isinstance(entry, LeRobotEntry):
        return {f"adapters/{ADAPTER.name}": sha256_file(ADAPTER)} if ADAPTER.is_file() else {}
    if not isinstance(entry, ServerEntry):
        return {}
    named = [*words_of(entry), *module_files(entry, folder)]
    return {
        word: sha256_file((folder / word).resolve())  # of a link, what it leads to
        for word in named
        if word not in entry.files and not Path(word).is_absolute() and (folder / word).is_file()
    }


def loading_command(entry: Entry, path: Path, contract: ObservationContract) -> list[str]:
    """The command of a child that loads a candidate as its host does, and ends.

    Raises:
        ConfigError: A checkpoint is not given the observation in its order.
        ContractError: It names what the observation does not have.
    """
    return [word for word in _own(entry, path, contract) if word not in ("--port", PORT)] + [
        "--check"
    ]


def _own(entry: Entry, path: Path, contract: ObservationContract) -> list[str]:
    """Our host. `-P`: what lies beside the entry is not found by an `import`."""
    if isinstance(entry, TrainedEntry):
        _require_whole(entry, contract)
    widths = widths_of(entry, contract)
    known = ["--observation", contract.hash()] if isinstance(entry, TrainedEntry) else []
    return [
        sys.executable, "-P", "-c", HERE, str(ROOT), "serve-candidate", str(path.resolve()),
        "--port", PORT, "--sha256", entry.sha256,
        *(word for name, width in widths.items() for word in ("--width", f"{name}={width}")),
        *known,
    ]  # fmt: skip


def _require_whole(entry: TrainedEntry, contract: ObservationContract) -> None:
    """Refuse an observation of a checkpoint that is not the vector of the contract, in order."""
    [(name, given)] = entry.observation.items()
    columns = columns_of(given.channels, contract, where=f"observation.{name}")
    if columns.tolist() != list(range(contract.dim)):
        raise ConfigError(
            where=f"observation.{name}.channels of the candidate {entry.name}",
            found=f"{', '.join(given.channels)} ({len(columns)} numbers)",
            expected=f"{', '.join(contract.slices)} ({contract.dim} numbers), as a checkpoint is "
            "given them",
            action="Name all channels of the observation contract, in its order.",
        )


def _lerobot(entry: LeRobotEntry) -> list[str]:
    # Not resolved: the link to an interpreter is what makes its environment.
    interpreter = Path(entry.interpreter).absolute()
    if not ADAPTER.is_file():
        raise ConfigError(
            where=f"the candidate {entry.name}, of kind lerobot",
            found=f"without {ADAPTER}",
            expected="the adapter that serves policies of LeRobot",
            action="Work in a checkout of genpolicy; the adapter is no part of the package.",
        )
    return [
        str(interpreter), str(ADAPTER), entry.pretrained_model, "--port", PORT,
        "--device", entry.device,
    ]  # fmt: skip
