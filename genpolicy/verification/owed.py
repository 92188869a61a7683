"""How long each invocation of a rollout had to take, drawn again from what was measured.

Journals state a time for every invocation and for every further check of a candidate. Here the
same times are drawn again, in other words than the virtual clock's: from the rows of the latency
evidence, the declared bounds and the planned perturbations, by the named streams of the root seed.
A clock that is faster on paper than the policy was on the machine states other times.
"""

import math
import statistics
from collections import defaultdict
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from genpolicy.seeds import stream
from genpolicy.verification.journal_source import Message, read_messages
from genpolicy.verification.sensed import SENSED, Sensed, sensed_s

ROUNDING_S = 1e-9
CHECK = "project"
"""The term that every further candidate costs once more."""
DELAYS = {"queue_reorder": "queue", "network_jitter": "network", "policy_stall": "sample"}
"""Which term of an invocation a perturbation of this kind adds its `magnitude_s` to; of jitter a
share of it."""

FLOW = (
    "exposure", "capture", "decode", "transfer", "preprocess", "encode", "sample", "select",
    "project", "network", "queue",
)  # fmt: skip
"""The terms in the order in which an observation meets them."""
COLD = "sample"
"""The term that the first call costs more of."""
UNCHECKED, STALE = "reject_candidate", "reject_stale"
ON_ARRIVAL = (UNCHECKED, STALE)
"""Actions that wait for what took too long; the others act when its time is over."""
GOES_ON = "continue"

Row = Mapping[str, Any]


@dataclass(frozen=True)
class Hit:
    """What a perturbation does to one invocation.

    Attributes:
        term: The term that takes longer; empty for none.
        more_s: By how much, s.
        factor: How many times as long every measured term takes.
        lost: Its answer never comes.
    """

    term: str = ""
    more_s: float = 0.0
    factor: float = 1.0
    lost: bool = False


class Times:
    """What latencies are drawn from.

    Args:
        rows: Rows of `latency.parquet`.
        declared: Least and most of each declared term, s.
        perturbations: The planned ones, by name: `kind` and its fields.
        root_seed: Root seed of the ladder.
        deadlines: What each term may take, s, and what is done beyond; none: held to nothing.
    """

    def __init__(
        self,
        rows: Iterable[Row],
        *,
        declared: Mapping[str, tuple[float, float]],
        perturbations: Mapping[str, Row],
        root_seed: int,
        deadlines: Mapping[str, tuple[float, str]] | None = None,
    ) -> None:
        self._deadlines = dict(deadlines or {})
        self._declared, self._planned, self._seed = declared, perturbations, root_seed
        warm: dict[str, dict[str, list[float]]] = defaultdict(lambda: defaultdict(list))
        whole: dict[tuple[str, str], dict[tuple[int, ...], float]] = defaultdict(dict)
        for row in rows:
            if row["source"] != "measured":
                continue
            method, how, seconds = row["method"], row["temperature"], row["seconds"]
            if how == "warm":
                warm[method][row["component"]].append(seconds)
            which = (row["run"], row["process"], row["repeat"])
            sums = whole[method, how]
            sums[which] = sums.get(which, 0.0) + seconds
        self._warm = {m: {t: sorted(v) for t, v in terms.items()} for m, terms in warm.items()}
        self._start_s = {
            method: _cold_start_s(whole[method, "cold"].values(), whole[method, "warm"].values())
            for method in warm
        }

    def sensed_s(self, condition: str, start: int, exposure: int) -> dict[str, float]:
        """What each sensor term of an exposure takes, s; infinite where it never comes."""
        key = ("exposed", condition, start, exposure)
        lots = stream(self._seed, *key).random(len(SENSED) + 2)
        return sensed_s(self._planned[condition], self._declared, list(map(float, lots)))

    def begins_with_s(
        self, method: str, condition: str, start: int, number: int, exposure: int
    ) -> float:
        """What invocation `number` takes from that exposure to its first candidate, s.

        NaN of an unknown method.
        """
        return sum(self.terms_s(method, condition, start, number, exposure).values(), start=0.0)

    def terms_s(
        self, method: str, condition: str, start: int, number: int, exposure: int
    ) -> dict[str, float]:
        """The same by term, in the order of the flow, s."""
        sensed_s = self.sensed_s(condition, start, exposure)
        hit, measured = self.hit(condition, start, number), self._warm.get(method, {})
        drawn_s = {} if measured else {COLD: math.nan}
        for term in FLOW if measured else ():
            if term in sensed_s:
                drawn_s[term] = sensed_s[term]
                continue
            lot = self._lot(condition, start, number, term)
            if term in self._declared:
                least_s, most_s = self._declared[term]
                drawn_s[term] = least_s + (most_s - least_s) * lot
            else:
                drawn_s[term] = hit.factor * _at(measured.get(term, ()), lot)
        if hit.term in drawn_s:
            drawn_s[hit.term] += hit.more_s
        if number == 0:
            drawn_s[COLD] += self._start_s.get(method, math.nan)
        return drawn_s

    def owes(
        self, method: str, condition: str, start: int, number: int, exposure: int
    ) -> list[tuple[str, str, float]]:
        """Terms of an invocation that take too long: which, what is done, and when it is known, s.

        The last one is that which ends it, if any does.
        """
        found, begun_s = [], 0.0
        for term, drawn_s in self.terms_s(method, condition, start, number, exposure).items():
            most_s, action = self._deadlines.get(term, (math.inf, GOES_ON))
            if not drawn_s <= most_s:
                found.append((term, action, begun_s + most_s))
                if action not in (*ON_ARRIVAL, GOES_ON):
                    break
            begun_s += drawn_s
        return found

    def check_owes(self, check_s: float) -> list[tuple[str, str]]:
        """The same of the check of a further candidate, without when."""
        most_s, action = self._deadlines.get(CHECK, (math.inf, GOES_ON))
        return [] if check_s <= most_s else [(CHECK, action)]

    def check_s(
        self, method: str, condition: str, start: int, number: int, candidate: int
    ) -> float:
        """What the check of a further candidate takes, s; the first further one is 1."""
        factor = self.hit(condition, start, number).factor
        seconds = self._warm.get(method, {}).get(CHECK, [])
        return factor * _at(seconds, self._lot(condition, start, number, CHECK, candidate))

    def hit(self, condition: str, start: int, number: int) -> Hit:
        """What the planned perturbation does to an invocation."""
        planned = self._planned[condition]
        kind = planned["kind"]
        if kind not in (*DELAYS, "compute_contention", "chunk_drop"):
            return Hit()
        lots = stream(self._seed, "perturbation", condition, start, number).random(2)
        if not lots[0] < planned["probability"]:
            return Hit()
        if kind == "compute_contention":
            return Hit(factor=planned["factor"])
        if kind == "chunk_drop":
            return Hit(lost=True)
        share = float(lots[1]) if kind == "network_jitter" else 1.0
        return Hit(DELAYS[kind], share * planned["magnitude_s"])

    def _lot(self, condition: str, start: int, number: int, *names: str | int) -> float:
        return float(stream(self._seed, "latency", condition, start, number, *names).random())


def _cold_start_s(cold_s: Iterable[float], warm_s: Iterable[float]) -> float:
    """What the first call costs on top of a typical one; NaN where no first call was measured."""
    worst_s = max(cold_s, default=math.nan)
    more_s = worst_s - statistics.median(warm_s)
    return 0.0 if more_s < 0.0 else more_s


def _at(seconds: Sequence[float], lot: float) -> float:
    """The measured time at a share of all, which is one of them; NaN where none was measured."""
    return seconds[min(len(seconds) - 1, math.floor(lot * len(seconds)))] if seconds else math.nan


@dataclass
class _Owed:
    """What an invocation owes for terms that took too long."""

    exposed_ns: int
    begun_ns: int
    terms: list[tuple[str, str, float]]
    unchecked: set[int] = field(default_factory=set)
    checks: list[tuple[str, str]] = field(default_factory=list)
    stated: list[tuple[str, str]] = field(default_factory=list)
    failed_ns: float = math.inf

    def state(self, m: Message, period_ns: int) -> str:
        """Take an overrun in; why it is not owed, or not there, in words."""
        term, action = m["detail"].split()
        said = (term, action)
        self.stated.append(said)
        owed = [one for one in self.terms if one[:2] == said]
        if self.stated.count(said) > len(owed) + self.checks.count(said):
            return f"states {m['detail']!r}, and that term took no longer than it may"
        if owed and action not in ON_ARRIVAL and said not in self.checks:
            known_ns = max(self.exposed_ns + owed[0][2] * 1e9, self.begun_ns)
            if not -ROUNDING_S * 1e9 <= m["t"] - known_ns <= period_ns + ROUNDING_S * 1e9:
                return f"states {m['detail']!r} at {m['t']} ns, known at {known_ns:.0f} ns"
        return ""

    def missing(self, end_ns: float, period_ns: int) -> list[tuple[str, str, float]]:
        """What had to be stated by the end of the session, and was not.

        What a policy that failed would have taken after its deadline, nobody waits for.
        """
        end_ns = min(end_ns, self.failed_ns)
        return [
            one
            for one in self.terms
            if one[1] not in ON_ARRIVAL
            and one[:2] not in self.stated
            and max(self.exposed_ns + one[2] * 1e9, self.begun_ns) + period_ns < end_ns
        ]

    def forbids(self, candidate: int) -> bool:
        """Whether a candidate may not be judged, since its check or its transport took too long."""
        return candidate in self.unchecked or any(one[1] == STALE for one in self.terms)


@dataclass
class _Session:
    """One rollout while its events go by."""

    method: str
    condition: str
    start: int
    numbers: dict[str, int]
    checks: dict[str, int]
    answers: dict[str, str]
    period_ns: int
    owed: dict[str, _Owed] = field(default_factory=dict)

    def __post_init__(self) -> None:
        self.sensed = Sensed(self.condition, self.start, self.period_ns)


def stated_otherwise(path: Path, times: Times) -> Iterator[str]:
    """What a journal of rollouts states that is not what was drawn again, in words.

    Raises:
        IntegrityError: No regular file.
        BadInputError: Not a whole journal.
        KeyError, TypeError, ValueError: An event that cannot be read.
    """
    sessions: dict[str, _Session] = {}
    for kind, m in read_messages(path):
        name = str(m.get("session"))
        if kind == "session":
            labels = m["labels"]
            own = (str(labels["method"]), str(labels["perturbation"]), int(labels["start"]))
            sessions[name] = _Session(*own, {}, {}, {}, int(m["period_ns"]))
        elif kind in ("exposure", "arrived"):
            sessions[name].sensed.read(kind, m)
        elif kind == "invocation":
            yield from _stated(m, sessions[name], times)
        elif kind == "latency":
            yield from _made_of(m, sessions[name], times)
        elif kind == "joined":
            sessions[name].answers[m["chunk_id"]] = m["invocation"]
        elif kind == "candidate":
            yield from _arrived(m, sessions[name], times)
        elif kind == "end":
            yield from _left_out(m, sessions[name], times)
            yield from sessions[name].sensed.otherwise(m["t"], times.sensed_s)


def _stated(m: Message, session: _Session, times: Times) -> Iterator[str]:
    own = (session.method, session.condition, session.start)
    which = f"invocation {m['id']!r}"
    if m["stage"] == "begin":
        number = session.numbers.setdefault(m["id"], len(session.numbers))
        exposure, exposed_ns = session.sensed.newest
        owed_s = times.begins_with_s(*own, number, exposure)
        owed = session.owed[m["id"]] = _Owed(exposed_ns, m["t"], times.owes(*own, number, exposure))
        if (CHECK, UNCHECKED) in [one[:2] for one in owed.terms]:
            owed.unchecked.add(0)
    elif m["stage"] == "check":
        number = session.numbers[m["id"]]
        candidate = session.checks[m["id"]] = session.checks.get(m["id"], 0) + 1
        which += f", candidate {candidate}"
        owed_s = times.check_s(*own, number, candidate)
        also = times.check_owes(owed_s)
        session.owed[m["id"]].checks += also
        if (CHECK, UNCHECKED) in also:
            session.owed[m["id"]].unchecked.add(candidate)
    elif m["stage"] == "overrun":
        if why := session.owed[m["id"]].state(m, session.period_ns):
            yield f"{which} {why}"
        return
    elif m["stage"] == "fault":
        session.owed[m["id"]].failed_ns = m["t"]
        return
    else:
        return
    if not abs(float(m["detail"]) - owed_s) <= ROUNDING_S:
        yield f"{which} states {float(m['detail']):.9g} s, {owed_s:.9g} s by the measured times"


def _made_of(m: Message, session: _Session, times: Times) -> Iterator[str]:
    own = (session.method, session.condition, session.start, session.numbers[m["id"]])
    for term, drawn_s in times.terms_s(*own, session.sensed.newest[0]).items():
        if not abs(float(m[f"{term}_s"]) - drawn_s) <= ROUNDING_S:
            yield f"{term} of invocation {m['id']!r} states {m[f'{term}_s']} s, {drawn_s:.9g} drawn"


def _arrived(m: Message, session: _Session, times: Times) -> Iterator[str]:
    name = session.answers.get(str(m["chunk_id"]), str(m["chunk_id"]))
    if times.hit(session.condition, session.start, session.numbers[name]).lost:
        yield f"invocation {m['chunk_id']!r} is judged, and it was to be lost"
    if session.owed[name].forbids(int(m["index"])):
        yield f"candidate {m['index']} of {name!r} is judged, and it took longer than it may"


def _left_out(m: Message, session: _Session, times: Times) -> Iterator[str]:
    """What took too long, and of which nobody says that anything was done."""
    for name, owed in session.owed.items():
        lost = times.hit(session.condition, session.start, session.numbers[name]).lost
        for term, action, _ in [] if lost else owed.missing(m["t"], session.period_ns):
            yield f"invocation {name!r} states no {f'{term} {action}'!r}, which it owes"
