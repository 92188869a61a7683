"""The states of recovery, followed again: only legal ones, and nothing of the policy meanwhile."""

from collections.abc import Iterator

from genpolicy.verification.journal_source import Message

Finding = tuple[str, str]
IDLE, HOLD, ASKED, PERSON = "idle", "hold", "ask_human", "person"
ABORTED, STOPPED = "abort", "stopped"
PRIMITIVES = ("retreat", "classical_return")
CALLS = (ASKED, PERSON, ABORTED)
"""States that need somebody: from the first of them on no success is the policy's."""
LEADS_TO = {
    IDLE: (HOLD,),
    HOLD: (*PRIMITIVES, ASKED),
    **{one: (*PRIMITIVES, IDLE, HOLD, ABORTED) for one in PRIMITIVES},
    ASKED: (PERSON, ABORTED, IDLE),
    PERSON: (IDLE, ABORTED),
    ABORTED: (IDLE,),
    STOPPED: (IDLE,),
}
"""Where each state may go; a stop may come in every one."""


class Recovering:
    """Follows the recovery of one session.

    Attributes:
        state: Where it stands.
        called: Whether it has ever needed somebody.
    """

    def __init__(self) -> None:
        self.state = IDLE
        self.called = False

    def follow(self, kind: str, m: Message) -> Iterator[Finding]:
        """Take an event in; yields a transition that there is not, and what the policy does."""
        if kind == "accept" and self.state != IDLE:
            yield "P8.recovery", f"The policy acts while recovery is in {self.state!r}."
        elif kind == "recovery":
            old, new = m["old"], m["new"]
            leads = (*LEADS_TO.get(old, ()), *([] if old == STOPPED else [STOPPED]))
            if old != self.state or new not in leads or new == old:
                yield "P8.recovery", f"From {self.state!r} recovery goes {old!r} to {new!r}."
            self.state = new
            self.called |= new in CALLS


class Failed:
    """Counts the primitives that failed: out of each the arm holds, or recovery is given up."""

    def __init__(self) -> None:
        self._count = 0

    def follow(self, m: Message) -> Iterator[Finding]:
        """Take a `recovery` event in; yields a count that is another one."""
        if m["old"] in (STOPPED, ABORTED) and m["new"] == IDLE:
            self._count = 0  # a person let it begin anew
        self._count += m["old"] in PRIMITIVES and m["new"] in (HOLD, ABORTED)
        if m["failures"] != self._count:
            yield "P8.failures", f"{self._count} primitives failed, {m['failures']} are noted."
        self._count = m["failures"]
