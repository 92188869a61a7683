"""What the chunks of a rollout must have been made of, derived again from their journal.

Which earlier predictions had a say in which rows follows from what had been enqueued by then, from
the chain of predecessors and from times; so do the actions that a chunk was drawn to go on from.
What is stated must be just that: who may leave out a vote may choose among blends. Means and
distances are taken here in other words than where chunks are joined; the samples that they rest on
are drawn again by whoever asks.
"""

import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from genpolicy.verification.joined import BLENDS
from genpolicy.verification.journal_source import Message, floats
from genpolicy.verification.pose import ACTION_DIM, ROTATION

Array = NDArray[np.float64]

OLDEST, RUNNING = "ensemble_oldest", "running_average"
NEAREST, GUIDED, STARTED = "bidirectional", "real_time", "warm_start"
DRAWN_ON = (GUIDED, STARTED)
"""Rules by which a sample was drawn with the plan before in hand."""
ONE_PLAN = (NEAREST, *DRAWN_ON)
"""Rules that look at the newest earlier plan alone, the same for every candidate."""
TURN_M = 0.1
"""What a unit of a column of a rotation counts as, m, where distances are compared."""


@dataclass(frozen=True)
class Said:
    """Rows of an earlier chunk that had a say in rows of a new one.

    Attributes:
        invocation: Of the earlier chunk.
        draw: Which of its samples entered the queue.
        first: First row of the new chunk that it had a say in.
        stop: Row behind the last one.
        shift: Its own row is that of the new chunk plus this.
        commanded: Its admitted actions for these rows. Shape (stop - first, 10).
        left: All its admitted actions from the first of these rows on. Shape (>= 1, 10).
    """

    invocation: str
    draw: int
    first: int
    stop: int
    shift: int
    commanded: Array
    left: Array


@dataclass(frozen=True)
class Made:
    """What a judged candidate was made of.

    Attributes:
        rule: How it was joined.
        turn: Number of the candidate in its invocation.
        draw: Which sample it rests on.
        said: Earlier chunks that had a say, oldest first.
        lead: Rows that the plan before covers while the policy thinks.
    """

    rule: str
    turn: int
    draw: int
    said: tuple[Said, ...]
    lead: int

    @property
    def guided(self) -> bool:
        """Whether it was drawn to go on, or start, from an earlier plan."""
        return self.rule in DRAWN_ON and bool(self.said)

    @property
    def blended(self) -> bool:
        """Whether earlier predictions were mixed into its numbers."""
        return self.rule in BLENDS and bool(self.said)

    @property
    def chosen(self) -> bool:
        """Whether an earlier plan decided which sample it is."""
        return self.rule == NEAREST and bool(self.said)


class Rejoined:
    """Follows one session.

    Args:
        opened: Its `session` event.
    """

    def __init__(self, opened: Message) -> None:
        self._opened = opened
        self._begun: dict[str, tuple[int, int]] = {}
        self._joined: dict[str, tuple[Message, int]] = {}
        self._at_first: dict[str, tuple[int, int]] = {}
        self._plan: dict[str, Mapping[str, list[int]]] = {}
        self._turns: dict[str, int] = {}
        self._entered: list[tuple[Message, Message]] = []

    def begin(self, m: Message) -> None:
        """An invocation begins, and states what it sees."""
        self._begun[m["id"]] = (m["exposed_ns"], len(self._entered))

    def join(self, m: Message) -> Iterator[str]:
        """A candidate is made; yields what it may not rest on, in words."""
        name, rule = m["invocation"], m["rule"]
        self._joined[m["chunk_id"]] = m, len(self._entered)
        if rule in ONE_PLAN and self._plan.setdefault(name, m["parents"]) != m["parents"]:
            yield f"{name!r} rests on {m['parents']}, and its first candidate on another plan"

    def judge(self, m: Message) -> Iterator[str]:
        """The candidate is judged; yields what is wrong with the sample that it rests on."""
        own, entered = self._joined[m["chunk_id"]]
        name = own["invocation"]
        self._turns[m["chunk_id"]] = m["index"]
        if m["index"] == 0:
            self._at_first[name] = own["t"], entered
        if own["draw"] != m["index"] and not (own["rule"] == NEAREST and own["parents"]):
            yield f"candidate {m['index']} of {name!r} is sample {own['draw']}, and nothing chose"

    def enter(self, chunk: Message) -> Iterator[str]:
        """A chunk enters the queue; yields who had a say in it and should not, or should."""
        own, entered = self._joined[chunk["chunk_id"]]
        name = own["invocation"]
        begun_ns, before = self._begun[name]
        if chunk["start_ns"] != begun_ns:
            yield f"{name!r} starts at {chunk['start_ns']} ns, and saw what was at {begun_ns} ns"
        when = own["t"], entered
        if own["rule"] == NEAREST:
            when = self._at_first.get(name, (0, 0))
        elif own["rule"] in DRAWN_ON:
            when = chunk["start_ns"], before
        due = self._due(chunk, *when, newest=own["rule"] in ONE_PLAN)
        if own["parents"] != due:
            yield f"{name!r} rests on {own['parents']}, required {due} by its journal"
        self._entered.append((chunk, own))

    def made(self, candidate: Message, own: Message) -> Made:
        """What a judged candidate states that it was made of.

        Args:
            candidate: Its `candidate` event.
            own: Its `joined` event.

        Raises:
            KeyError, ValueError: It names what did not enter the queue before.
        """
        start_ns, _ = self._begun[own["invocation"]]
        found = {made["invocation"]: (chunk, made) for chunk, made in self._entered}
        said = []
        for parent, (first, stop) in own["parents"].items():
            chunk, made = found[parent]
            shift, rest = divmod(start_ns - chunk["start_ns"], chunk["period_ns"])
            actions = floats(chunk["actions"]).reshape(chunk["rows"], ACTION_DIM)
            rows = actions[first + shift : stop + shift]
            if rest or first + shift < 0 or len(rows) != stop - first:
                raise ValueError(f"rows {first} to {stop} of {own['invocation']!r} by {parent!r}")
            left = actions[first + shift :]
            said.append(Said(parent, made["draw"], first, stop, shift, rows, left))
        order = {made["invocation"]: place for place, (_, made) in enumerate(self._entered)}
        said.sort(key=lambda one: order[one.invocation])
        return Made(
            rule=own["rule"], turn=candidate["index"], draw=own["draw"], said=tuple(said),
            lead=self._opened["replan_lead_rows"],
        )  # fmt: skip

    def _due(
        self, chunk: Message, now_ns: int, entered: int, *, newest: bool
    ) -> dict[str, list[int]]:
        """Rows by invocation that what had entered by then has a say in."""
        period_ns = chunk["period_ns"]
        first = max(round((now_ns - chunk["start_ns"]) / period_ns), 0)
        before = self._entered[:entered]
        chain = _chain(chunk["predecessor"], [one for one, _ in before])
        due: dict[str, list[int]] = {}
        for one, made in before:
            stop = first
            while one["chunk_id"] in chain and self._speaks(one, chunk, stop):
                stop += 1
            if stop > first:
                due[made["invocation"]] = [first, stop]
        return dict(list(due.items())[-1:]) if newest else due

    def _speaks(self, one: Message, chunk: Message, row: int) -> bool:
        """Whether an earlier chunk could have been executed where a row is due."""
        due_ns = chunk["start_ns"] + row * chunk["period_ns"]
        own_row, rest = divmod(due_ns - one["start_ns"], one["period_ns"])
        youngest_ns = due_ns - self._opened["maximum_age_ns"][chunk["phase"]]
        return bool(
            chunk["start_ns"] >= one["start_ns"]
            and chunk["period_ns"] == one["period_ns"]
            and rest == 0
            and own_row < min(one["rows"], self._opened["execution_horizon"])
            and due_ns <= one["valid_until_ns"]
            and youngest_ns <= one["condition_ns"]
        )


def _chain(chunk_id: str, entered: Sequence[Message]) -> set[str]:
    """Ids of the unbroken line of predecessors, from one backwards."""
    found: set[str] = set()
    for one in reversed(entered):
        if one["chunk_id"] == chunk_id:
            found.add(chunk_id)
            chunk_id = one["predecessor"]
    return found


def mean_of(
    made: Made, own: Array, earlier: Mapping[str, Array], *, decay: float, newest: float
) -> Array:
    """The blend of samples: in each row the weighted mean of those who had a say.

    Args:
        made: Who that was.
        own: The new sample. Shape (K, 10).
        earlier: Samples of the earlier ones, by invocation. Shapes (K, 10).
        decay: Each prediction weighs exp(-decay) of the one before, counted from the oldest or
            the newest as the rule is called.
        newest: Share of each prediction in the running average of it and all before.
    """
    blended = np.array(own)
    for row in range(min(one.first for one in made.said), max(one.stop for one in made.said)):
        speaking = [one for one in made.said if one.first <= row < one.stop]
        sides = [earlier[one.invocation][row + one.shift] for one in speaking] + [own[row]]
        if made.rule == RUNNING:
            blended[row] = _one_into_the_next(sides, newest)
        else:
            blended[row] = _fading(sides if made.rule == OLDEST else sides[::-1], decay)
        blended[row, ROTATION] = _upright(blended[row, ROTATION])
    return blended


def _fading(sides: Sequence[Array], decay: float) -> Array:
    total, share, whole = np.zeros(ACTION_DIM), 1.0, 0.0
    for side in sides:
        total += share * side
        whole += share
        share *= math.exp(-decay)
    return total / whole


def _one_into_the_next(sides: Sequence[Array], newest: float) -> Array:
    mean = sides[0]
    for side in sides[1:]:
        mean = mean + newest * (side - mean)
    return mean


def _upright(columns: Array) -> Array:
    """Two columns (6,) made orthonormal, the first one keeping its direction."""
    first, second = columns[:3], columns[3:]
    normal = np.cross(first, second)
    first, normal = first / math.hypot(*first), normal / math.hypot(*normal)
    return np.concatenate([first, np.cross(normal, first)])


def ways_to_plan(made: Made, samples: Array, decay: float) -> Array:
    """How far samples (N, K, 10) are from the plan before: a weighted norm, m. Shape (N,)."""
    plan = made.said[-1]
    apart = samples[:, plan.first : plan.stop] - plan.commanded
    apart[..., ROTATION] *= TURN_M
    share = np.exp(-0.5 * decay * np.arange(plan.stop - plan.first))
    away_m = np.linalg.norm(share[:, None] * apart, axis=(1, 2))
    return np.where(np.isfinite(away_m), away_m, math.inf)


def goes_on_from(made: Made, rows: int) -> tuple[Array, Array]:
    """What a chunk was drawn to go on from: actions (rows, 10), and weights (rows,).

    A row weighs 1 while the plan before is executed for sure, then c (e^c - 1) / (e - 1), where c
    falls evenly from 1 to 0 over the rest of what it says. A chunk that started from it started
    from every row that is left of it, and from its last one where none is; each weighs 1.
    """
    actions, weights = np.zeros((rows, ACTION_DIM)), np.zeros(rows)
    if made.rule == STARTED:
        for plan in made.said:
            behind = np.repeat(plan.left[-1:], rows, axis=0)
            actions, weights = np.concatenate([plan.left, behind])[:rows], np.ones(rows)
        return actions, weights
    for plan in made.said:
        fixed = min(made.lead, plan.stop)
        for row in range(plan.first, plan.stop):
            left = (plan.stop - row) / (plan.stop - fixed + 1)
            falling = left * math.expm1(left) / math.expm1(1.0)
            actions[row] = plan.commanded[row - plan.first]
            weights[row] = 1.0 if row < fixed else falling
    return actions, weights
