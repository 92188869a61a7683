"""Two criteria of a small gate, defined against the order of the alphabet."""

from dataclasses import dataclass

from gates.criterion import Measured, criteria_of, criterion
from gates.engine import GateSpec
from gates.evidence import Evidence
from gates.settings import GateSettings
from genpolicy.documents.document import Document


@dataclass(frozen=True)
class Number:
    n: float


A, B = Document("a.json", Number), Document("b.json", Number)


@criterion(">=", question="Many?", look_at="Look.")
def second_in_the_alphabet(evidence: Evidence, settings: GateSettings) -> Measured:
    """A number of one file."""
    return Measured(evidence.document("in", A).n)


@criterion("<=", question="Few?", look_at="Look.", derived=lambda settings: 2.0)
def first_in_the_alphabet(evidence: Evidence, settings: GateSettings) -> Measured:
    """A number of two files, one of which is read twice."""
    evidence.document("in", A)
    return Measured(evidence.document("in", B).n + evidence.document("in", A).n)


SPEC = GateSpec("A", GateSettings, criteria_of(globals()), ("in/*.json",), "work", "go on", ())
