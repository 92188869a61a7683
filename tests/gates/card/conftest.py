"""A team that signs, over a chain that is proved once."""

import sys
from pathlib import Path

import pytest

from gates import proof

sys.path.insert(0, str(Path(__file__).parent))


@pytest.fixture(scope="session")
def _chain(_ladder):
    return proof.prove_chain(_ladder, "D")


@pytest.fixture
def quick_chain(_chain, monkeypatch):
    """The chain as proved once: for tests that change nothing below the card."""
    monkeypatch.setattr(proof, "prove_chain", lambda root, through: _chain)


@pytest.fixture
def team(ladder, request):
    if "below" not in getattr(request.node, "name", ""):
        request.getfixturevalue("quick_chain")
    from team import Team

    return Team(ladder)
