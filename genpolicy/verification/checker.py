"""The independent checker: re-proves P1-P5, P7 and conservation from the journal alone.

It shares no code with the executor, the stub or feasibility, and believes nothing that they say
about freshness: phase, calibration, newest observation, voiding events and stops are followed
again from the raw events, and every accepted action is compared bit for bit with the chunk that
was admitted. Where the caller says what the robot is, executed rows are proved feasible again, by
MuJoCo (`motion`). Rules: P1 gate to stub, P2 watchdog, P3 monotone, P4 chain, P5 newest first, P6
feasible (of a blend by its own admission, `joined`), P7 stop is sticky (`silence` is one), P8 a
person has the arm (`attended`), `clock` (no answer before its time), `sensor` (nothing seen before
it arrived), `state` (what was measured), `conservation`, `journal` (form), `settings` (limits).
"""

import hashlib
from collections.abc import Iterable
from pathlib import Path

from genpolicy.verification.attended import Attended
from genpolicy.verification.balance import Balance
from genpolicy.verification.continuity import Continuity
from genpolicy.verification.dated import NEVER_NS, misdated
from genpolicy.verification.expected import ALWAYS, ExpectedSettings
from genpolicy.verification.invocations import Invocations
from genpolicy.verification.joined import Joined
from genpolicy.verification.journal_source import Message, read_messages
from genpolicy.verification.measured import Measured
from genpolicy.verification.motion import ExpectedMotion, MotionProof
from genpolicy.verification.pose import ACTION_DIM
from genpolicy.verification.report import CheckReport, Violation
from genpolicy.verification.silence import Silence
from genpolicy.verification.world_view import WorldView

LAYERS = 6
FLOAT_HEX_DIGITS = 16
ROW_HEX_DIGITS = ACTION_DIM * FLOAT_HEX_DIGITS


def check_journal(
    path: Path, expected: ExpectedSettings | None = None, motion: ExpectedMotion | None = None
) -> CheckReport:
    """Check a journal file.

    Args:
        path: MCAP journal of one or more sessions.
        expected: Settings that every session must declare; None trusts the declaration.
        motion: What every executed row must keep to; None proves no row feasible.

    Raises:
        IntegrityError: No regular file.
        BadInputError: Not a whole journal.
    """
    return check_messages(read_messages(path), expected, motion)


def check_messages(
    messages: Iterable[tuple[str, Message]],
    expected: ExpectedSettings | None = None,
    motion: ExpectedMotion | None = None,
) -> CheckReport:
    """Check events, each `(kind, {"session", "n", "t", ...payload})`, in the order written."""
    report = CheckReport()
    proof = None if motion is None else MotionProof(motion)
    sessions: dict[str, _Session] = {}
    for kind, message in messages:
        name = str(message.get("session"))
        if name not in sessions:
            sessions[name] = _Session(name, report, expected, proof)
        sessions[name].read(kind, message)
    for session in sessions.values():
        session.finish()
    report.sessions = len(sessions)
    return report


class _Session:
    """Follows one session."""

    def __init__(
        self,
        name: str,
        report: CheckReport,
        expected: ExpectedSettings | None,
        proof: MotionProof | None,
    ) -> None:
        self.name, self.report, self.expected, self.proof = name, report, expected, proof
        self.settings: Message = {}
        self.world = WorldView(expected)
        self.balance = Balance()
        self.invocations = Invocations(expected)
        self.joined = Joined()
        self.attended = Attended()
        self.measured = Measured(proof)
        self.silence = Silence(expected.silence_stop_s if expected else None)
        self.continuity = Continuity(proof)
        self.chunks: dict[str, Message] = {}
        self.open: dict[int, Message] = {}
        self.head: tuple[int, str] | None = None
        self.n, self.t, self.ended, self.last_sequence = -1, NEVER_NS, False, -1
        self.last_start_ns: int | None = None
        self.last_due_ns: int | None = None
        self.last_row: dict[int, int] = {}
        self.unanswered_ns: int | None = None

    def flag(self, rule: str, sentence: str) -> None:
        """Note a violation at the current event."""
        self.report.violations.append(Violation(self.name, self.n, rule, sentence))

    def _flag_all(self, findings: Iterable[tuple[str, str]]) -> None:
        for rule, sentence in findings:
            self.flag(rule, sentence)

    def read(self, kind: str, m: Message) -> None:
        """Follow one event."""
        self.report.events += 1
        if m.get("n") != self.n + 1:
            self.flag("journal.gap", f"Event {m.get('n')} follows event {self.n}.")
        self.n = m.get("n", self.n + 1)
        self._flag_all(misdated(self.t, kind, m))
        self.t = m["t"]
        late_arrival = kind == "discard" and m.get("reason") == "end_of_episode"
        # A stop is heard at any time.
        if self.ended and not late_arrival and kind != "supervisor":
            self.flag("journal.after_end", f"A {kind} event follows the end of the session.")
        if (self.n == 0) != (kind == "session"):
            self.flag("journal.settings", f"Event {self.n} is {kind}; settings stand first, once.")
        try:
            for part in (self.invocations, self.attended, self.measured, self.silence):
                self._flag_all(part.follow(kind, m))
            self._follow(kind, m)
            self._flag_all(self.joined.follow(kind, m, self.world.void_before, self.settings))
        except Exception as error:  # of what was forged, reading may raise anything
            self.flag("journal.malformed", f"A {kind} event cannot be read ({error!r}).")

    def finish(self) -> None:
        """After the last event."""
        if not self.ended:
            self.flag("journal.no_end", "The session has no end; its balance cannot be proved.")
        self._answered(self.t, final=True)
        self._flag_all(self.world.unnoted())

    def _follow(self, kind: str, m: Message) -> None:
        if kind in ("accept", "fallback"):
            self._answered(self.t)
            self._check_accept(kind, m)
            self.unanswered_ns = self.t
        elif kind == "hold":
            self._answered(self.t)
            self.continuity.hold(m)
            self.unanswered_ns = None
        elif kind == "session":
            self._check_settings(m)
        elif kind == "enqueue":
            self._check_enqueue(m)
        elif kind in ("discard", "finish"):
            self._check_close(kind, m)
        elif kind == "end":
            self.ended = True
            for sentence in self.balance.check_end(m, self.n):
                self.flag("conservation", sentence)
        else:
            self._flag_all(self.world.follow(kind, m, self.balance.generated_chunks))
            self.continuity.see(kind, m)
            if kind == "supervisor" and self.world.stopped:
                self._answered(self.t)
                self.unanswered_ns = None
            if kind in ("reset", "mode"):
                self._interrupted(kind, m)
            if kind == "supervisor" and m["event"] == "human_reset":
                self.continuity.forget()

    def _interrupted(self, kind: str, m: Message) -> None:
        """Somebody else commands, or has: what was commanded last may not be where the arm is."""
        if self.proof is not None:
            self.proof.forget(self.name)
        if kind == "reset" or "intervention" in (m["old"], m["new"]):
            self.continuity.forget(blind=kind == "reset")
        if kind == "reset":
            self.head = self.last_due_ns = self.last_start_ns = None

    # P2: silence ------------------------------------------------------------------------------

    def _answered(self, now_ns: int, *, final: bool = False) -> None:
        """An action, a hold or the end of the session ends the silence after an action."""
        if self.unanswered_ns is None:
            return
        silence_ns = now_ns - self.unanswered_ns
        limit_ns = self.settings.get("period_ns", 0) + self.settings.get("watchdog_ns", 0)
        self.report.longest_silence_ns = max(self.report.longest_silence_ns, silence_ns)
        if not limit_ns - silence_ns >= 0:
            self.flag("P2.watchdog", f"No action and no hold for {silence_ns} ns.")
        if final:
            self.unanswered_ns = None

    # P1, P3, P5, P7: accepted actions ----------------------------------------------------------

    def _check_accept(self, kind: str, m: Message) -> None:
        self.report.checked_actions += kind == "accept"
        self.report.checked_fallback_actions += kind == "fallback"
        chunk = self.open.get(m["arrival"])
        if chunk is None or chunk["chunk_id"] != m["chunk_id"]:
            self.flag("P1.admitted", f"{m['chunk_id']!r} is not an enqueued, open chunk.")
            return
        row = m["row"]
        self.balance.executed(m["arrival"])
        self._check_bits(chunk, row, m)
        self._check_window(chunk, row)
        self._flag_all(self.world.objections(chunk, kind, self.t, self.settings))
        age_ns = self.t - chunk["condition_ns"]
        self.report.oldest_action_ns = max(self.report.oldest_action_ns, age_ns)
        if m["age_ns"] != age_ns:
            self.flag("P1.age", f"The age is noted as {m['age_ns']} ns and is {age_ns} ns.")
        self._check_begin(row, m)
        self._check_order(chunk, row, m)
        self._flag_all(self.continuity.follow(chunk, m, self.settings))
        self._check_motion(chunk, row)

    def _check_motion(self, chunk: Message, row: int) -> None:
        if chunk["motion"] is None:
            self.flag("P6.ground", f"{chunk['chunk_id']!r} does not say what it was held against.")
        elif self.proof is not None:
            self._reprove(chunk, row)

    def _reprove(self, chunk: Message, row: int) -> None:
        assert self.proof is not None
        self.report.reproved_actions += 1
        period_s = self.settings["period_ns"] / 1e9
        for rule, sentence in self.proof.objections(
            self.name, chunk, row, phase=self.world.phase, period_s=period_s
        ):
            self.flag(rule, f"Row {row} of {chunk['chunk_id']!r}: {sentence}")

    def _check_bits(self, chunk: Message, row: int, m: Message) -> None:
        admitted = chunk["actions"][row * ROW_HEX_DIGITS : (row + 1) * ROW_HEX_DIGITS]
        if len(m["action"]) != ROW_HEX_DIGITS or m["action"] != admitted:
            self.flag("P1.bits", f"The action is not row {row} of {chunk['chunk_id']!r}.")

    def _check_window(self, chunk: Message, row: int) -> None:
        due_ns = chunk["start_ns"] + row * chunk["period_ns"]
        if not due_ns <= self.t < due_ns + chunk["period_ns"]:
            self.flag("P1.window", f"Row {row} is due from {due_ns} ns, accepted at {self.t} ns.")
        if not 0 <= row < min(chunk["rows"], self.settings["execution_horizon"]):
            self.flag("P1.horizon", f"Row {row} lies beyond the execution horizon.")
        first, last = chunk["checked_rows"]
        if not first <= row < last:
            self.flag("P1.checked_rows", f"Row {row} was not among those that were checked.")
        if not chunk["valid_until_ns"] - self.t >= 0:
            self.flag("P1.valid_until", f"The chunk was valid until {chunk['valid_until_ns']} ns.")

    def _check_begin(self, row: int, m: Message) -> None:
        """A chunk begins by the row at which it was meant to take over, or may begin late."""
        lead, phase = self.settings["replan_lead_rows"], self.world.phase
        late = m["arrival"] not in self.last_row and row > lead
        declared = self.settings["late_chunk"].get(phase)
        if late and declared != "continue":
            self.flag("P1.late", f"A chunk begins at row {row}; {phase!r} says {declared!r}.")

    def _check_order(self, chunk: Message, row: int, m: Message) -> None:
        arrival, start_ns = m["arrival"], chunk["start_ns"]
        due_ns = start_ns + row * chunk["period_ns"]
        if row <= self.last_row.get(arrival, -1):
            self.flag("P3.row", f"Row {row} comes after row {self.last_row[arrival]}.")
        if m["sequence"] <= self.last_sequence:
            self.flag("P3.sequence", f"Sequence {m['sequence']} after {self.last_sequence}.")
        if self.last_start_ns is not None and start_ns < self.last_start_ns:
            self.flag("P3.start", "The chunk starts before the one accepted last.")
        if self.last_due_ns is not None and due_ns <= self.last_due_ns:
            self.flag("P3.due", "The action is due no later than the one accepted last.")
        if any(other > arrival and c["start_ns"] <= self.t for other, c in self.open.items()):
            self.flag("P5.newest", f"A newer chunk than {chunk['chunk_id']!r} has started.")
        self.last_row[arrival], self.last_sequence = row, m["sequence"]
        self.last_start_ns, self.last_due_ns = start_ns, due_ns

    # P4 and the queue --------------------------------------------------------------------------

    def _check_enqueue(self, m: Message) -> None:
        chunk_id = m["chunk_id"]
        for sentence in self.balance.arrived(m["arrival"], m["rows"]):
            self.flag("conservation", sentence)
        self.report.chunks += 1
        if chunk_id in self.chunks:
            self.flag("P3.duplicate", f"{chunk_id!r} was enqueued before.")
        for other in self.open.values():
            if m["condition_ns"] < other["condition_ns"] or m["start_ns"] < other["start_ns"]:
                self.flag("P5.order", f"{chunk_id!r} is older than {other['chunk_id']!r}, queued.")
        self.chunks[chunk_id] = self.open[m["arrival"]] = m
        data = bytes.fromhex(m["actions"])
        if len(data) * 2 != m["rows"] * ROW_HEX_DIGITS:
            self.flag("P1.admitted", f"{chunk_id!r} has not {m['rows']} rows of {ACTION_DIM}.")
        if m["raw"] and len(m["raw"]) != len(m["actions"]):
            self.flag("P1.admitted", f"{chunk_id!r} was projected from another number of rows.")
        if hashlib.sha256(data).hexdigest() != m["actions_sha256"]:
            self.flag("P1.hash", f"The actions of {chunk_id!r} are not those that were admitted.")
        layers = m["layers"]
        if len(layers) != LAYERS or not all(passed is True for passed in layers.values()):
            self.flag("P1.admitted", f"{chunk_id!r} did not pass all {LAYERS} layers.")
        if m["period_ns"] != self.settings["period_ns"]:
            self.flag("P1.period", f"{chunk_id!r} has a period of {m['period_ns']} ns.")
        head = self.head[1] if self.head else ""
        if m["predecessor"] not in ("", head):
            self.flag("P4.chain", f"{chunk_id!r} continues {m['predecessor']!r}, not {head!r}.")
        if len(self.open) > self.settings["queue_capacity"]:
            self.flag("settings.capacity", f"{len(self.open)} chunks are queued.")
        self._check_ground(m)
        self.head = (m["arrival"], chunk_id)

    def _check_ground(self, chunk: Message) -> None:
        """What it was projected from, the scene that was seen, and a state that is young."""
        motion = chunk["motion"]
        if self.proof is None:
            return
        self._flag_all(self.proof.expected.projection.objections(chunk))
        if motion is None:
            return  # a row of it that is executed is a violation of its own (P6.ground)
        if motion["scene"] not in self.world.scenes_of(chunk["chunk_id"]):
            self.flag("P6.scene", f"{chunk['chunk_id']!r} was checked in another scene than seen.")
        age_ns = self.t - motion["measured_ns"]
        limit_ns = self.settings["maximum_age_ns"].get(chunk["phase"])
        if limit_ns is None or not 0 <= age_ns <= limit_ns:
            self.flag("P6.state_age", f"{chunk['chunk_id']!r} rests on joints {age_ns} ns old.")

    def _check_close(self, kind: str, m: Message) -> None:
        arrival, reason = m["arrival"], str(m["reason"]) if kind == "discard" else None
        if kind == "discard" and m["at"] != self.world.place_of(m, arrival in self.open):
            self.flag("journal.refused", f"{m['chunk_id']!r} is not discarded at {m['at']!r}.")
        if m.get("at") == "arrival":
            self.report.chunks += 1
            for sentence in self.balance.refused(arrival, m["rows"], str(reason)):
                self.flag("conservation", sentence)
        elif arrival in self.open:
            if self.open.pop(arrival)["chunk_id"] != m["chunk_id"]:
                self.flag("conservation", f"Arrival {arrival} ends as {m['chunk_id']!r}.")
            for sentence in self.balance.closed(arrival, m["rows"], m["ended"], reason):
                self.flag("conservation", sentence)
        else:
            self.flag("conservation", f"Arrival {arrival} ends without being queued.")
        if m["ended"] == "discarded":
            self.report.discarded[str(reason)] += 1
        breaks_chain = kind == "discard" and reason not in ("superseded", "queue_overflow")
        if self.head is not None and self.head[0] == arrival and breaks_chain:
            self.head = None

    def _check_settings(self, m: Message) -> None:
        expected = {**ALWAYS, **(self.expected.declared() if self.expected else {})}
        self.settings = {**m, **expected}
        if m["checks_missing"]:
            self.report.checks_missing.update(m["checks_missing"])
            self.flag("settings.checks", f"Checks are missing: {m['checks_missing']}.")
        for key, value in expected.items():
            if m[key] != value:
                self.flag("settings.limits", f"{key} is {m[key]!r}, expected {value!r}.")
        self.world.declare(self.settings)
