"""The planner is known by its task, and by nothing else."""

from genpolicy.contract.planner import PLANNER, planner_sha256
from genpolicy.integrity.hashing import sha256_bytes


def test_its_identity_is_of_its_name_and_its_task():
    """By hand: the canonical text of both."""
    text = f'{{\n  "planner": "{PLANNER}",\n  "task": "{"a" * 64}"\n}}\n'
    assert planner_sha256("a" * 64) == sha256_bytes(text.encode())
    assert planner_sha256("a" * 64) != planner_sha256("b" * 64)
