"""The eleven terms of latency, each its own span with an owner; a missing one is unknown.

Whoever owns a term declares what it may take and what is done beyond that (chapter 4.1). The list
of what may be done is closed, and each member means one thing on the clock.
"""

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from enum import StrEnum


class Owner(StrEnum):
    """Who answers for a term."""

    MODEL = "model"
    PERCEPTION = "perception"
    CONTROLLER = "controller"
    SAFETY = "safety"


class Term(StrEnum):
    """One term of the latency, in the order of the data flow."""

    EXPOSURE = "exposure"
    CAPTURE = "capture"
    DECODE = "decode"
    TRANSFER = "transfer"
    PREPROCESS = "preprocess"
    ENCODE = "encode"
    SAMPLE = "sample"
    SELECT = "select"
    PROJECT = "project"
    NETWORK = "network"
    QUEUE = "queue"


OWNERS: dict[Term, Owner] = {
    Term.EXPOSURE: Owner.PERCEPTION,
    Term.CAPTURE: Owner.PERCEPTION,
    Term.DECODE: Owner.PERCEPTION,
    Term.TRANSFER: Owner.PERCEPTION,
    Term.PREPROCESS: Owner.MODEL,
    Term.ENCODE: Owner.MODEL,
    Term.SAMPLE: Owner.MODEL,
    Term.SELECT: Owner.MODEL,
    Term.PROJECT: Owner.SAFETY,
    Term.NETWORK: Owner.CONTROLLER,
    Term.QUEUE: Owner.CONTROLLER,
}
MEASURED_TERMS = (Term.PREPROCESS, Term.ENCODE, Term.SAMPLE, Term.SELECT, Term.PROJECT)
DECLARED_TERMS = tuple(term for term in Term if term not in MEASURED_TERMS)


class DeadlineAction(StrEnum):
    """What is done where a term takes longer than it may."""

    CONTINUE = "continue"
    """It is counted, and the answer goes on; the deadline of the whole answer still holds."""
    DROP_OBSERVATION = "drop_observation"
    """The observation is dropped; the next invocation begins at once, with a newer one."""
    SKIP_INVOCATION = "skip_invocation"
    """The invocation is skipped; the next one begins a period later, and the plan goes on."""
    CANCEL_CANDIDATE = "cancel_candidate"
    """What is being sampled is cancelled; the next invocation begins at once."""
    REJECT_CANDIDATE = "reject_candidate"
    """The candidate gets no verdict and is refused; the next candidate is checked, if any is left.
    """
    REJECT_STALE = "reject_stale"
    """The answer is refused when it comes; the controller holds once its plan is over."""
    FALLBACK = "fallback"
    """The invocation is cancelled, and recovery begins."""


ENDING = frozenset({
    DeadlineAction.DROP_OBSERVATION, DeadlineAction.SKIP_INVOCATION,
    DeadlineAction.CANCEL_CANDIDATE, DeadlineAction.FALLBACK,
})  # fmt: skip
"""Actions that end an invocation as soon as the time of the term is over."""

_BEFORE_SAMPLING = frozenset(list(Term)[: list(Term).index(Term.SAMPLE)])
FITTING: dict[DeadlineAction, frozenset[Term]] = {
    DeadlineAction.CONTINUE: frozenset(Term),
    DeadlineAction.DROP_OBSERVATION: _BEFORE_SAMPLING,
    DeadlineAction.SKIP_INVOCATION: _BEFORE_SAMPLING,
    DeadlineAction.CANCEL_CANDIDATE: frozenset({Term.ENCODE, Term.SAMPLE, Term.SELECT}),
    DeadlineAction.REJECT_CANDIDATE: frozenset({Term.PROJECT}),
    DeadlineAction.REJECT_STALE: frozenset({Term.NETWORK, Term.QUEUE}),
    DeadlineAction.FALLBACK: frozenset(Term),
}
"""Terms that an action can be executed for: what has not been sampled cannot be cancelled."""


@dataclass(frozen=True)
class TermDeadline:
    """What a term may take, s, and what is done where it takes longer."""

    most_s: float
    action: DeadlineAction


@dataclass(frozen=True)
class Overrun:
    """A term of one invocation that took longer than it may.

    Attributes:
        term: The term.
        action: What is done.
        known_s: When its time is over, from the begin of the invocation, s.
    """

    term: Term
    action: DeadlineAction
    known_s: float


def overruns(
    terms_s: Mapping[str, float], deadlines: Mapping[Term, TermDeadline]
) -> Iterator[Overrun]:
    """Overruns of an invocation in the order of its data flow, up to the one that ends it.

    Args:
        terms_s: What each term takes, by name, s.
        deadlines: What each may take; a term without one is not held to any.
    """
    begun_s = 0.0
    for term in Term:
        allowed = deadlines.get(term)
        if allowed is not None and not terms_s[term] <= allowed.most_s:
            yield Overrun(term, allowed.action, begun_s + allowed.most_s)
            if allowed.action in ENDING:
                return
        begun_s += terms_s[term]
