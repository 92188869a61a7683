"""The supervisor's process, and the names of everything that it had loaded at its end."""

import json
import sys
from pathlib import Path

from genpolicy.wall_clock.process import main

if __name__ == "__main__":
    report = Path(sys.argv.pop(1))
    code = main()
    report.write_text(json.dumps(sorted(sys.modules)))
    sys.exit(code)
