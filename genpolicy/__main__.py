"""`python -m genpolicy`: the same as the command `genpolicy`."""

import sys

from genpolicy.cli.main import main

if __name__ == "__main__":
    sys.exit(main())
