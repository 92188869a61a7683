"""`python -m gates`: the same as `genpolicy gates`."""

import sys

from gates.commands import gates
from genpolicy.cli.shell import run_program

if __name__ == "__main__":
    sys.exit(run_program(gates, "python -m gates"))
