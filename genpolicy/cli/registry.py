"""The verbs of the command line, in the order of the help. A verb is a module with `add`."""

import argparse
from typing import Any, Protocol

from genpolicy.cli import audit, ingest


class Command(Protocol):
    """What a verb's module offers."""

    def add(self, verbs: "argparse._SubParsersAction[Any]") -> None:
        """Add the verb's parser, whose default `run` takes the options and gives an exit code."""
        ...


COMMANDS: tuple[Command, ...] = (audit, ingest)
