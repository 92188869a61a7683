"""A failure that a search found, as a file by which its rollout is run again."""

from dataclasses import dataclass

from genpolicy.documents.document import Count, Document


@dataclass(frozen=True)
class Failure:
    """All that the rollout hangs on beside code and parameters, and what came of it.

    Attributes:
        task: The task.
        method: The candidate.
        checkpoint: Its identity.
        training_seed: Number of its training seed.
        root_seed: Root seed, below which every draw of the rollout is named.
        condition: Condition of the plan.
        perturbation: Name under which it was run; names the draws, with `number`.
        severity: Size of the disturbance; None where the condition has none.
        number: Count in its search.
        point: What the search asked for, in [0, 1].
        start: The start, as JSON.
        start_sha256: Hash of the state after reset.
        outcome: How it ended.
        events_sha256: Hash of all events of its journal, in order.
    """

    task: str
    method: str
    checkpoint: str
    training_seed: int
    root_seed: int
    condition: str
    perturbation: str
    severity: float | None
    number: Count
    point: list[float]
    start: str
    start_sha256: str
    outcome: str
    events_sha256: str


FAILURE = Document("failures/<method>__<condition>__<number>.json", Failure)
"""One file a failure; its name says whose, where, and which."""
