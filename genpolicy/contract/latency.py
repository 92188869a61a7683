"""The eleven terms of latency, each its own span with an owner; a missing one is unknown."""

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
