"""P6 of joined chunks: an id and an admission of their own, and no vote that had run out.

A blend rests on predictions of earlier invocations. What those passed says nothing of it, so it
must have been judged itself, under an id that none of them has. An earlier prediction may speak for
a row only where its own chunk could still have been executed: on the chain of predecessors, not
voided, within horizon, validity and age. In a session that says how its chunks join (its label
`joining`) every chunk of the policy says what it was made of.
"""

from collections.abc import Iterator

from genpolicy.verification.journal_source import Message

Finding = tuple[str, str]
LABEL = "joining"
BLENDS = ("ensemble_oldest", "ensemble_newest", "running_average")


class Joined:
    """Follows what the chunks of one session were made of."""

    def __init__(self) -> None:
        self._rule = ""
        self._made: dict[str, Message] = {}
        self._passed: set[str] = set()
        self._refused: set[str] = set()
        self._queued: dict[str, Message] = {}

    def follow(
        self, kind: str, m: Message, void_before: dict[str, int], settings: Message
    ) -> Iterator[Finding]:
        """Take an event in; yields what a chunk may not have been made of.

        Args:
            kind: Of the event.
            m: The event.
            void_before: By cause, before when what was conditioned is void, ns.
            settings: What the session is held to.
        """
        if kind == "session":
            self._rule = m["labels"].get(LABEL, "")
        elif kind == "joined":
            self._made[m["chunk_id"]] = m
            self._passed.discard(m["chunk_id"])
            self._refused.discard(m["chunk_id"])
            if m["rule"] != self._rule:
                yield "P6.rule", f"A chunk joins by {m['rule']!r} in a session of {self._rule!r}."
        elif kind == "candidate":
            if all(passed is True for passed in m["layers"].values()):
                self._passed.add(m["chunk_id"])
                self._refused.discard(m["chunk_id"])
            else:
                self._passed.discard(m["chunk_id"])
                self._refused.add(m["chunk_id"])
        elif kind == "enqueue":
            if m["chunk_id"] in self._refused:
                yield "P1.verdict", f"{m['chunk_id']!r} comes, and was refused when it was judged."
            if m["source"] != "policy":
                return
            if self._rule or m["chunk_id"] in self._made:
                yield from self._entered(m, void_before, settings)
            self._queued[m["chunk_id"]] = m

    def _entered(
        self, chunk: Message, void_before: dict[str, int], settings: Message
    ) -> Iterator[Finding]:
        name = repr(chunk["chunk_id"])
        made = self._made.get(chunk["chunk_id"])
        if made is None:
            yield "P6.blend", f"{name} comes, and nothing says what it was made of."
            return
        if chunk["chunk_id"] not in self._passed:
            yield "P6.blend", f"{name} comes without an admission of its own."
        of_its_own = chunk["chunk_id"] not in (made["invocation"], *made["parents"])
        if made["rule"] in BLENDS and made["parents"] and not of_its_own:
            yield "P6.blend", f"{name} is a blend and has the id of one of its parents."
        linked = self._linked(chunk["predecessor"])
        for parent, (first, stop) in made["parents"].items():
            before = linked.get(parent)
            if before is None or not 0 <= first < stop <= chunk["rows"]:
                yield "P6.vote", f"{name} rests on {parent!r}, which is not on its chain."
                continue
            why = _run_out(before, chunk, stop - 1, void_before, settings)
            if why:
                yield "P6.vote", f"{name} rests on {parent!r} in row {stop - 1}, {why}."

    def _linked(self, chunk_id: str) -> dict[str, Message]:
        """Chunks along the chain of predecessors, by invocation."""
        found: dict[str, Message] = {}
        passed: set[str] = set()
        while chunk_id not in passed and (chunk := self._queued.get(chunk_id)) is not None:
            passed.add(chunk_id)  # a chain that a forger closed has no end
            made = self._made.get(chunk_id)
            found[chunk_id if made is None else made["invocation"]] = chunk
            chunk_id = chunk["predecessor"]
        return found


def _run_out(
    before: Message, chunk: Message, row: int, void_before: dict[str, int], settings: Message
) -> str:
    """Why an earlier chunk's own row may not be executed where a row is due; empty if it may."""
    due_ns = chunk["start_ns"] + row * chunk["period_ns"]
    own_row = (due_ns - before["start_ns"]) / before["period_ns"]
    limit_ns = settings["maximum_age_ns"].get(chunk["phase"])
    age_ns = due_ns - before["condition_ns"]
    same = all(before[k] == chunk[k] for k in ("phase", "calibration_epoch", "session_epoch"))
    if not same or any(before["condition_ns"] < void_ns for void_ns in void_before.values()):
        return "which is void"
    if not 0 <= own_row < settings["execution_horizon"]:
        return f"whose own row {own_row:g} is never executed"
    if not before["valid_until_ns"] - due_ns >= 0:
        return "which is no longer valid then"
    if limit_ns is None or not limit_ns - age_ns >= 0:
        return f"which is {age_ns} ns old then"
    return ""
