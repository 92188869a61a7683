"""The eleven terms of latency, each its own span with an owner; a missing one is unknown."""

import math
from collections.abc import Mapping
from dataclasses import dataclass
from enum import StrEnum

from genpolicy.errors import ContractError


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
COMPUTE_TERMS = (Term.PREPROCESS, Term.ENCODE, Term.SAMPLE, Term.SELECT, Term.PROJECT)
DECLARED_TERMS = tuple(term for term in Term if term not in COMPUTE_TERMS)


@dataclass(frozen=True)
class LatencySpans:
    """Duration of each known term of one action, s.

    Attributes:
        seconds: Known terms; a term that is absent is unknown, never zero.
    """

    seconds: Mapping[Term, float]

    def __post_init__(self) -> None:
        for term, value in self.seconds.items():
            if not (math.isfinite(value) and value >= 0.0):
                raise ContractError(
                    where=f"latency span {term}",
                    found=repr(value),
                    expected="a finite duration >= 0 in s",
                    action="Leave an unknown term out; check the clock behind a negative one.",
                )
        object.__setattr__(self, "seconds", dict(self.seconds))

    @property
    def missing(self) -> tuple[Term, ...]:
        """Terms that are unknown."""
        return tuple(term for term in Term if term not in self.seconds)

    @property
    def total_s(self) -> float | None:
        """Sum of all eleven terms, s; None while one of them is unknown."""
        return None if self.missing else math.fsum(self.seconds.values())
