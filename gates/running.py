"""Whether the code that runs is the code of the repository that is judged.

A report binds the files below its root. An installed copy, or a checkout elsewhere, could judge it
with other rules; so what is imported is held against what lies there.
"""

from pathlib import Path

import gates
import genpolicy
from genpolicy.errors import IntegrityError
from genpolicy.integrity.hashing import sha256_file

COMPILED = "__pycache__"


def require_running_code(root: Path) -> None:
    """Refuse to judge a repository with other code than its own.

    A root without the packages (a workspace that uses an installed copy) has none of its own.

    Args:
        root: Repository root.

    Raises:
        IntegrityError: A file of an imported package is not, byte for byte, that below the root.
    """
    for package in (genpolicy, gates):
        running, own = Path(str(package.__file__)).parent, root / package.__name__
        if not (own / "__init__.py").is_file() or own.resolve() == running.resolve():
            continue
        here, there = code_files(running), code_files(own)
        for name in sorted(here | there):
            found = sha256_file(running / name) if name in here else "missing"
            expected = sha256_file(own / name) if name in there else "missing"
            if found != expected:
                raise IntegrityError(
                    where=f"the running {package.__name__}/{name}",
                    found=f"{found[:16]} of {running}",
                    expected=f"{expected[:16]} of {own}",
                    action=f"Judge {root} with its own code: run `python -m gates` in it.",
                )


def code_files(folder: Path) -> frozenset[str]:
    """Files of a package, by path inside it, without what the interpreter compiles."""
    return frozenset(
        path.relative_to(folder).as_posix()
        for path in folder.rglob("*")
        if path.is_file() and COMPILED not in path.parts
    )
