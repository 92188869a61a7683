"""Selectors: which candidate of an invocation becomes the proposal; declared by name, logged."""

from collections.abc import Callable, Sequence

from genpolicy.contract.chunk import Candidate, Proposal
from genpolicy.errors import ConfigError, ContractError

Selector = Callable[[Sequence[Candidate]], Proposal]


def select(candidates: Sequence[Candidate], *, selector: str = "first") -> Proposal:
    """The proposal that the named selector makes of the candidates.

    Raises:
        ConfigError: Unknown selector.
        ContractError: No candidate.
    """
    if selector not in SELECTORS:
        raise ConfigError(
            where="selector",
            found=repr(selector),
            expected=f"one of {', '.join(SELECTORS)}",
            action="Choose a registered selector.",
        )
    if not candidates:
        raise ContractError(
            where="candidates of an invocation",
            found="empty",
            expected="at least one",
            action="Hold; there is nothing to propose.",
        )
    return SELECTORS[selector](candidates)


def _first(candidates: Sequence[Candidate]) -> Proposal:
    """The first candidate, unseen: a fair draw from the policy's distribution."""
    chosen = candidates[0]
    return Proposal(metadata=chosen.metadata, actions=chosen.actions, selected_by="first")


SELECTORS: dict[str, Selector] = {"first": _first}
