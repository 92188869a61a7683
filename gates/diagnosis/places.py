"""The chapter's order of looking, and where in it each criterion stands.

Starting with the sampler can hide a missing variable or a stale frame, so the order is that of the
data's way: what is behind a red place may be its consequence. A criterion says its place itself, at
the head of the sentence on where to look.
"""

from gates.criterion import Criterion

PLACES = (
    "data semantics",
    "multimodality",
    "conditioning",
    "generator training",
    "sampler",
    "timing and queue",
    "feasibility",
    "contact controller",
    "evaluator",
)
HEADS = {
    "Data semantics": "data semantics",
    "Multimodality": "multimodality",
    "Conditioning": "conditioning",
    "Baselines": "conditioning",
    "Generator training": "generator training",
    "Entry and server": "generator training",
    "Policy process": "generator training",
    "Sampler": "sampler",
    "Timing": "timing and queue",
    "Feasibility": "feasibility",
    "Contact controller": "contact controller",
    "Recovery": "contact controller",
    "Evaluator": "evaluator",
}
"""Head of `look_at`, and its place. What a simpler policy, another encoder or a longer history
would have given is a question of conditioning; who was brought stands where others are trained."""
WITHOUT_HEAD = {"promotion_e_value": "evaluator"}
"""The comparison itself comes last."""


def place_of(criterion: Criterion) -> str:
    """Place of a criterion of gates A to D.

    Raises:
        KeyError: It names none.
    """
    named = WITHOUT_HEAD.get(criterion.id)
    return named or HEADS[criterion.look_at.partition(":")[0]]
