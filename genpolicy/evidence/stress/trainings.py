"""The same methods from another training seed: who of a comparison was trained more than once."""

from collections.abc import Iterable

from genpolicy.candidates.contenders import Contender
from genpolicy.candidates.judged import JudgedPolicy, trained


def of_training(judged: Iterable[Contender], seed: int) -> list[Contender]:
    """Those that were trained here, in their order, from another training seed.

    A planner has no training, and of who was brought this ladder knows one: both stay out.

    Args:
        judged: Who stands in the comparison.
        seed: Number of the training seed.

    Raises:
        BadInputError: A checkpoint is missing or malformed.
    """
    return [
        other
        for one in judged
        if isinstance(one, JudgedPolicy)
        for other in trained(one.folder.parents[1], [one.name], seeds=[seed], device=one.device)
    ]
