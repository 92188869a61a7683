"""The task's planner among the methods that are compared: its name, and by what it is known."""

from typing import Final

from genpolicy.integrity.documents import canonical_json
from genpolicy.integrity.hashing import sha256_bytes

PLANNER: Final = "classical_planner"
"""Name of the method in every table, and in `stress.baselines`; no other policy may have it."""


def planner_sha256(task_sha256: str) -> str:
    """Identity of the planner of a task, by that of the task: it has no weights."""
    return sha256_bytes(canonical_json({"planner": PLANNER, "task": task_sha256}))
