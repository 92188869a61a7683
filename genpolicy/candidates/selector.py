"""The selector: which candidate of an invocation is proposed; one rule, timed and deployed.

It sees the candidates of one invocation and whether the layers refused one; it imports nothing that
knows the task, the future or whoever judges (chapter 6, 2.2), which an import contract holds.
"""

from collections.abc import Sequence

from genpolicy.contract.chunk import Candidate, Proposal
from genpolicy.contract.latency import OWNERS, Term
from genpolicy.errors import ContractError

SELECTOR = "first_admissible"
OWNER = str(OWNERS[Term.SELECT])


def propose(candidates: Sequence[Candidate], index: int = 0) -> Proposal:
    """The candidate whose turn it is, unseen: each is a fair draw of the policy's distribution.

    Raises:
        ContractError: There is no such candidate.
    """
    if not 0 <= index < len(candidates):
        raise ContractError(
            where="candidates of an invocation",
            found=f"{len(candidates)}",
            expected=f"a candidate {index}",
            action="Hold; there is nothing to propose.",
        )
    chosen = candidates[index]
    return Proposal(metadata=chosen.metadata, actions=chosen.actions, selected_by=SELECTOR)


def tries_another(index: int, count: int, *, stale: bool) -> bool:
    """Whether another candidate is tried after this one was refused.

    Args:
        index: The one that was refused.
        count: Candidates of the invocation.
        stale: Whether it was refused for its age or session, which all of them share.
    """
    return not stale and index + 1 < count
