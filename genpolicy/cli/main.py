"""The command `genpolicy`: one verb per step, one line per error, one meaning per exit code.

0 done, 1 a fault of ours, 2 bad configuration or bad input, 3 refused by a gate.
"""

import argparse
import sys
import traceback
from collections.abc import Sequence

from genpolicy.cli.registry import COMMANDS
from genpolicy.errors import GenpolicyError

DESCRIPTION = (
    "Import recordings of one's own and audit them: is there a need for a generator, and if not, "
    "what is wrong with the data?"
)
INTERRUPTED = 130


def main(arguments: Sequence[str] | None = None) -> int:
    """Entry point of the console script.

    Args:
        arguments: Words after the program's name; those of the process if absent.

    Returns:
        The exit code.
    """
    parser = argparse.ArgumentParser(prog="genpolicy", description=DESCRIPTION)
    verbs = parser.add_subparsers(dest="verb", required=True, metavar="VERB")
    for command in COMMANDS:
        command.add(verbs)
    options = parser.parse_args(arguments)
    try:
        return int(options.run(options))
    except GenpolicyError as error:
        print(f"genpolicy {options.verb}: {error}", file=sys.stderr)
        return error.exit_code
    except KeyboardInterrupt:
        print(f"genpolicy {options.verb}: interrupted; nothing was written", file=sys.stderr)
        return INTERRUPTED
    except Exception:
        traceback.print_exc()
        print(
            f"genpolicy {options.verb}: this is a fault of genpolicy, not of your input. "
            "Report the lines above.",
            file=sys.stderr,
        )
        return 1
