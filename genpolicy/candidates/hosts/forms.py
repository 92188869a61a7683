"""Is a file of the form that its kind needs? Read, and never run."""

import symtable
from pathlib import Path

from safetensors import SafetensorError, safe_open

from genpolicy.candidates.hosts.commands import require_known_words
from genpolicy.candidates.hosts.kinds import LeRobotEntry, ScriptedEntry
from genpolicy.candidates.hosts.lerobot_steps import require_steps
from genpolicy.candidates.hosts.lerobot_words import require_words
from genpolicy.candidates.hosts.served_weights import require_served_weights
from genpolicy.candidates.wire.entry import Entry, ServerEntry
from genpolicy.errors import BadInputError, ConfigError
from genpolicy.integrity.documents import read_json


def require_forms(entry: Entry, folder: Path) -> None:
    """Refuse files of another form than their kind needs, as far as reading them tells.

    Programs and checkpoints are loaded by a child besides: see `loadable`.

    Args:
        entry: What it is; its files are verified.
        folder: Of the entry's file.

    Raises:
        ConfigError: A module without the function; documents or weights of LeRobot that are none,
            or a config that may name a place, or processors that could run code; weights of a
            server that nothing pins, or what its command names elsewhere.
    """
    if isinstance(entry, ScriptedEntry):
        _require_function(folder / entry.file, entry.function.partition(":")[2])
    elif isinstance(entry, LeRobotEntry):
        for name in entry.essential(folder):
            read = _require_document if name.endswith(".json") else _require_weights
            read(folder / name)
        require_words(entry, folder)
        require_steps(entry, folder)
    elif isinstance(entry, ServerEntry):
        require_served_weights(entry, folder)
        require_known_words(entry, folder)


def _require_function(path: Path, name: str) -> None:
    """By the names that the module binds: to import it would run it."""
    try:
        # Bytes: a module may say its encoding itself. The stub knows texts only.
        table = symtable.symtable(path.read_bytes(), str(path), "exec")  # type: ignore[arg-type]
    except (SyntaxError, ValueError, RecursionError, MemoryError) as error:
        raise ConfigError(
            where=str(path),
            found=f"no Python module ({error})",
            expected="one that can be imported",
            action="Correct it, and write its hash into `files`.",
        ) from error
    bound = name in table.get_identifiers() and (
        (symbol := table.lookup(name)).is_assigned() or symbol.is_imported()
    )
    if not bound:
        raise ConfigError(
            where=str(path),
            found=f"a module without the function {name}",
            expected="`function: module:name` of the entry",
            action="Name a function of the module.",
        )


def _require_document(path: Path) -> None:
    try:
        found = read_json(path)
    except BadInputError as error:
        raise ConfigError(
            where=error.where,
            found=error.found,
            expected=f"{error.expected}, as LeRobot writes it",
            action="Save the policy again with LeRobot's `save_pretrained`.",
        ) from error
    if not isinstance(found, dict):
        raise ConfigError(
            where=str(path),
            found=f"JSON of type {type(found).__name__}",
            expected="a map, as LeRobot writes it",
            action="Save the policy again with LeRobot's `save_pretrained`.",
        )


def _require_weights(path: Path) -> None:
    try:
        with safe_open(path, framework="numpy"):
            return
    except SafetensorError as error:
        raise ConfigError(
            where=str(path),
            found=f"no file of tensors ({error})",
            expected="safetensors, as LeRobot writes them",
            action="Save the policy again with LeRobot's `save_pretrained`.",
        ) from error
