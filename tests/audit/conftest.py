"""Makes the planar task and the benchmark importable: test modules are imported by path."""

import sys
from pathlib import Path

import pytest

sys.path.insert(0, str(Path(__file__).parent))
sys.path.insert(0, str(Path(__file__).parents[2]))


@pytest.fixture(scope="session")
def valid():
    """An audit that finds valid modes; 20 of its episodes were disturbed."""
    from planar import audited

    return audited(recoveries=20, episodes=160)
