"""`genpolicy audit`, which lives above: its body names causes, and limits belong to the gates."""

import argparse
from importlib import import_module
from importlib.metadata import entry_points
from typing import Any

GROUP, COMMAND = "genpolicy.commands", "gates.audit.command"


def add(verbs: "argparse._SubParsersAction[Any]") -> None:
    """Add the verb `audit` of the package above, as it is registered, else by its name."""
    for point in entry_points(group=GROUP, name="audit"):
        point.load().add(verbs)
        return
    # An installation made before the command was registered.
    import_module(COMMAND).add(verbs)
