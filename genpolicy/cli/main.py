"""The program `genpolicy`: the commands of this package, and those that others register."""

import os
import sys
from collections.abc import Sequence
from pathlib import Path

from genpolicy.cli.kernel_cache import find_a_place

PACKAGE = Path(__file__).parents[1]


def main(arguments: Sequence[str] | None = None) -> int:
    """Entry point of the console script.

    Args:
        arguments: Words after the program's name; those of the process if absent.

    Returns:
        The exit code.
    """
    find_a_place(PACKAGE, os.environ)
    words = list(sys.argv[1:] if arguments is None else arguments)
    try:
        from genpolicy.cli.commands import program  # noqa: PLC0415 - typer may be what is broken
    except ImportError as error:
        if error.name is not None and error.name.startswith("genpolicy"):
            raise
        from genpolicy import doctor  # noqa: PLC0415

        print(f"genpolicy: {error}; the environment is not whole:", file=sys.stderr)
        doctor.main(["--json"] if "--json" in words else [])
        return 2
    return program(words)
