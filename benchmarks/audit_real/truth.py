"""What is true of a recording, and which verdicts are right of it.

A generator and the changes made to its recording say what is so, as `Facts`. The right verdict
follows from them in the order of diagnosis, never from what an audit says.
"""

from dataclasses import dataclass

from benchmarks.audit.catalogue import ONE_VALID, UNIMODAL, VALID, Answer

# Kinds of defects by what was planted; the words of `genpolicy.audit.semantics`.
DEFECTS = {
    "unit": ("unit",),
    "clock": ("clock", "drift", "lag"),
    "frame": ("frame", "mirror", "sign", "rotat"),
    "swap": ("swap", "frame"),
    "glued": ("glue",),
    "duplicate": ("duplicate",),
    "frozen": ("frozen",),
    "gap": ("gap", "rate", "jitter", "clock"),
    "calibration": ("calibration",),
}
UNRECORDED = ("unrecorded", "history", "sequence", "order")
OPEN = "insufficient_support"
NOT_RECORDED = Answer(OPEN, ("not_recorded",))
RIGHT, ALLOWED, UNDECIDED, WRONG = "right", "undecided, allowed", "undecided", "wrong"


@dataclass(frozen=True)
class Facts:
    """What is true of a recording.

    Attributes:
        modes: Ways in which one and the same situation was answered; 1 is a single way; 0 is not
            known, and nobody could tell from what was recorded.
        decided_by: What decides them: empty is a free choice that leaves no trace; `start`, `past`
            and `order` leave one outside the present observation; else the recorded column.
        names: Words of which one must occur where a recorded column is named.
        observed: The observation shows what decides.
        outcomes: Whether each episode succeeded is recorded.
        failing: All modes but one fail mostly.
        tremor: The spread that matters is white noise on the commands.
        defect: Key of `DEFECTS`; empty: none.
        also: Further verdicts that are right, and why, as pairs.
        undecided: Why a specialist may leave it open; empty: one would decide.
    """

    modes: int = 1
    decided_by: str = ""
    names: tuple[str, ...] = ()
    observed: bool = False
    outcomes: bool = False
    failing: bool = False
    tremor: bool = False
    defect: str = ""
    also: tuple[tuple[Answer, str], ...] = ()
    undecided: str = ""

    def answers(self) -> tuple[Answer, ...]:
        """Right verdicts, the first the one that is meant."""
        if self.defect:
            return (Answer("data_defect", DEFECTS[self.defect]),)
        return (*self._structure(), *(answer for answer, _ in self.also))

    def _structure(self) -> tuple[Answer, ...]:
        if self.tremor:
            return (Answer("pointwise_noise"),)
        if self.modes == 0:
            return (Answer(OPEN),)
        if self.modes < 2 or self.observed:
            return (UNIMODAL,)
        if self.decided_by in ("past", "order"):
            return (Answer("hidden_state", UNRECORDED),)
        if self.decided_by == "start":
            # At first the policy sees the start, later it does not: both say that it decides.
            return (Answer("hidden_state", ("start", *UNRECORDED)), UNIMODAL)
        if self.decided_by:
            return (Answer("hidden_state", self.names or (self.decided_by,)),)
        if not self.outcomes:
            return (NOT_RECORDED,)
        return (ONE_VALID,) if self.failing else (VALID,)

    def judged(self, verdict: str, variable: str, kind: str) -> str:
        """One of RIGHT, ALLOWED, UNDECIDED and WRONG."""
        if any(answer.fits(verdict, variable, kind) for answer in self.answers()):
            return RIGHT
        if verdict != OPEN:
            return WRONG
        return ALLOWED if self.undecided and not self.defect else UNDECIDED

    def as_text(self) -> str:
        """The right verdicts in words, as the committed table shows them."""
        found = [_words(answer) for answer in self.answers()]
        if self.undecided and not self.defect:
            found.append("or undecided")
        return ", ".join(dict.fromkeys(found))


def _words(answer: Answer) -> str:
    return f"{answer.cause}({'/'.join(answer.names)})" if answer.names else answer.cause
