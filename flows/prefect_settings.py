"""What Prefect reads while it is imported: import this first. What the caller has set stays."""

import os
import sys
from collections.abc import Sequence
from pathlib import Path


def home_of(arguments: Sequence[str]) -> Path:
    """Where Prefect keeps its database: in the workspace that a command line names, else here.

    Prefect reads it before any option is parsed; the same workspace finds its suspended runs again
    from every folder. One that is not there is refused later, and nothing is made in its place.
    """
    named = Path()
    for place, argument in enumerate(arguments):
        option, _, value = argument.partition("=")
        if option == "--workspace":
            named = Path(value or "".join(arguments[place + 1 : place + 2]))
    return (named if named.is_dir() else Path()).resolve() / ".prefect"


DEFAULTS = {
    "PREFECT_SERVER_EPHEMERAL_STARTUP_TIMEOUT_SECONDS": "120",
    "PREFECT_SERVER_ANALYTICS_ENABLED": "false",
    "PREFECT_SERVER_LOGGING_LEVEL": "CRITICAL",
    "PREFECT_HOME": str(home_of(sys.argv)),
    "PREFECT_CLIENT_MAX_RETRIES": "3",
    "DO_NOT_TRACK": "1",
}

for _name, _value in DEFAULTS.items():
    os.environ.setdefault(_name, _value)
