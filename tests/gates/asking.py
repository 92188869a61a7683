"""Two criteria of a small gate, defined against the order of the alphabet."""

from gates.criterion import Measured, criteria_of, criterion
from gates.engine import GateSpec
from gates.evidence import Evidence
from gates.settings import GateSettings


@criterion(">=", question="Many?", look_at="Look.")
def second_in_the_alphabet(evidence: Evidence, settings: GateSettings) -> Measured:
    """A number of one file."""
    return Measured(evidence.document("a.json")["n"])


@criterion("<=", question="Few?", look_at="Look.", derived=lambda settings: 2.0)
def first_in_the_alphabet(evidence: Evidence, settings: GateSettings) -> Measured:
    """A number of two files, one of which is read twice."""
    evidence.document("a.json")
    return Measured(evidence.document("b.json")["n"] + evidence.document("a.json")["n"])


SPEC = GateSpec("A", GateSettings, criteria_of(globals()), ("*.json",), "work", "go on", ())
