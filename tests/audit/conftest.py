"""Makes the planar task importable: test modules are imported by path, without packages."""

import sys
from pathlib import Path

sys.path.insert(0, str(Path(__file__).parent))
