"""What the words of a server's command name: files of its folder, modules, and what lies elsewhere.

Files of the folder are known by hash, wherever the evidence goes. Whatever else a word names is on
this machine alone: another machine has none or another one, and tomorrow so has this one.
"""

import csv
import re
import shutil
import sys
from collections.abc import Iterator
from importlib.metadata import Distribution, distributions
from pathlib import Path

from genpolicy.candidates.wire.entry import ServerEntry
from genpolicy.errors import ConfigError
from genpolicy.integrity.hashing import sha256_bytes

PYTHON = re.compile(r"(python|pypy)[0-9.]*$")
INTERPRETER = re.compile(r"(python|pypy|node|perl|ruby|julia|bash|sh)[0-9.]*$")
OPTION = re.compile(r"--?[A-Za-z][\w-]*=")
MODULE = re.compile(r"-[A-Za-z]*m([\w.]*)$")
"""Of Python's own options that which names a module, also `-mname` and behind others (`-um`)."""
TAKES = ("-W", "-X", "--check-hash-based-pycs")
"""Options of Python whose value is the next word."""
PROGRAMS = ("bin", "sbin")
"""Folders of installed programs: a program is named by a word of `PATH` or by its full path."""
SITES = ("lib/python*/site-packages", "lib/python*/dist-packages",
         "local/lib/python*/dist-packages")  # fmt: skip


def words_of(entry: ServerEntry) -> list[str]:
    """What its command may name a file by: its words, also behind `--x=`; no interpreter."""
    command = list(entry.command or ())
    if command and INTERPRETER.match(Path(command[0]).name):
        command = command[1:]
    return [word.partition("=")[2] if OPTION.match(word) else word for word in command]


def module_files(entry: ServerEntry, folder: Path) -> list[str]:
    """Files of the entry's folder that a module behind `-m` begins with; paths as in `files`.

    Python looks in the folder where it is started first, which is that of the entry.
    """
    module = _module_of(entry)
    if module is None:
        return []
    parts = module.split(".")
    packages = ["/".join([*parts[:end], "__init__.py"]) for end in range(1, len(parts) + 1)]
    own = [f"{'/'.join(parts)}.py", f"{'/'.join(parts)}/__main__.py"]
    return [name for name in (*packages, *own) if (folder / name).is_file()]


def installed_module(entry: ServerEntry, folder: Path) -> dict[str, str]:
    """The distribution of a module behind `-m` that does not lie in the folder.

    Returns:
        `name==version`, and the SHA-256 of what its record says of the module's files, which is of
        nothing where an editable install has none. Empty where none is known.
    """
    module = _module_of(entry)
    if module is None or module_files(entry, folder):
        return {}
    top = module.partition(".")[0]
    for found in _distributions(entry, folder):
        said = [row[:2] for row in csv.reader((found.read_text("RECORD") or "").splitlines())]
        own = sorted(row for row in said if row[0].split("/")[0] in (top, f"{top}.py"))
        if own or top in (found.read_text("top_level.txt") or "").split():
            hashed = "\n".join(" ".join(row) for row in own if row[1])
            return {f"{found.name}=={found.version}": sha256_bytes(hashed.encode())}
    return {}


def require_known_words(entry: ServerEntry, folder: Path) -> None:
    """Refuse a server that pins files, and whose command names what nothing of the entry pins.

    That is a file or a folder outside the folder of the entry, and a module that is neither in it,
    nor Python's own, nor of an installed distribution. The program itself is one of `PATH`, or lies
    in a folder of programs. An entry that pins nothing fails Gate B by name.

    Args:
        entry: What it is.
        folder: Of the entry's file.

    Raises:
        ConfigError: It names such a thing.
    """
    if not entry.files or entry.command is None:
        return
    program = Path(entry.command[0])
    for word in words_of(entry):
        named = Path(word)
        if word == entry.command[0] and named.is_absolute() and program.parent.name in PROGRAMS:
            continue
        leaves = named.is_absolute() or ".." in named.parts
        if leaves and ((folder / named).is_file() or (folder / named).is_dir()):
            _refuse(entry, word, "which lies outside the folder of the entry, or is named so")
    module = _module_of(entry)
    if module is None or module.partition(".")[0] in sys.stdlib_module_names:
        return
    if not module_files(entry, folder) and not installed_module(entry, folder):
        _refuse(entry, f"-m {module}", "a module that is neither there nor installed")


def _module_of(entry: ServerEntry) -> str | None:
    """The module that Python is told to run; None of another command."""
    words = iter(entry.command or ())
    if not PYTHON.match(Path(next(words, "")).name):
        return None
    for word in words:
        if word in TAKES:
            next(words, None)
        elif found := MODULE.match(word):
            return found[1] or next(words, None)
        elif not word.startswith("-") or word == "-c":
            return None
    return None


def _distributions(entry: ServerEntry, folder: Path) -> Iterator[Distribution]:
    """Those beside the interpreter of the command. Their records are read, and nothing is run."""
    assert entry.command is not None  # it has a module
    program = entry.command[0]
    place = shutil.which(program if "/" not in program else str(folder / program))
    # Not resolved: the link to an interpreter is what makes its environment.
    prefix = Path(place).absolute().parent.parent if place else Path("/nowhere")
    sites = [str(path) for site in SITES for path in sorted(prefix.glob(site))]
    return iter(distributions(path=sites) if sites else ())


def _refuse(entry: ServerEntry, word: str, why: str) -> None:
    raise ConfigError(
        where=f"command of the candidate {entry.name}",
        found=f"{word!r}, {why}",
        expected="files below the folder of the entry by their own names, and installed modules: "
        "no hash is of anything else",
        action="Put it into the folder of the entry (a module: or install it), and name it there.",
    )
