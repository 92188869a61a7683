"""The same methods from another training seed: who of a comparison was trained more than once."""

from collections.abc import Iterable, Mapping
from dataclasses import replace

from genpolicy.candidates.contenders import Contender
from genpolicy.candidates.judged import JudgedPolicy, trained
from genpolicy.evidence.stress.shard import Shard


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


def as_far(shards: Iterable[Shard], ran: Mapping[str, int]) -> list[Shard]:
    """The shards, each of as many starts as its method ran with the training that is judged.

    Args:
        shards: Of all starts.
        ran: Starts by method; of who is not named there it is not known, and all are run.
    """
    return [replace(shard, end=ran.get(shard.judged.name)) for shard in shards]
