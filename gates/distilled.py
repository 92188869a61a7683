"""What a candidate's distillation took, as a report says it; nothing is judged by it."""

from genpolicy.evidence.documents.given import Distilled

# The way back through a network costs about as much as two ways through it.
BACK = 2


def operations_ratio(said: Distilled) -> float:
    """Operations of both trainings over those of the teacher's, which is a plain one.

    Teacher and student are trained alike, so that the teacher has half of the gradients; each of
    them is one way through the network and the way back.
    """
    once = said.gradients / 2
    return (said.evaluations + BACK * said.gradients) / ((1 + BACK) * once)


def spent(said: Distilled) -> str:
    """The teacher, and what both trainings took."""
    return (
        f"distilled from {said.teacher} {said.teacher_sha256[:16]}…: {said.updates} updates and "
        f"about {operations_ratio(said):.3g} times the operations of one training, its teacher's "
        "included"
    )
