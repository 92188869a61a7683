"""What the action commands, and how: decided by the numbers, names only break ties.

For every pair of a commanded and an observed number it is asked whether the observed one goes
where the command says, or changes by what it says (`following`). All pairs are then assigned at
once. Where names and numbers contradict for a closed set of numbers (x answers the command of y,
and y that of x), that may be a fault of the recorder: names then stand, and the audit finds it.
"""

from collections.abc import Sequence
from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import linear_sum_assignment

from genpolicy.data.formats.commands import CommandForm
from genpolicy.data.formats.following import (
    MINIMUM_SAMPLES,
    Following,
    changes,
    levels,
    places,
    varies,
)
from genpolicy.data.grips import is_two_valued

Array = NDArray[np.float64]
Integers = NDArray[np.int64]
Flags = NDArray[np.bool_]

# Share of the motion that a command must explain to be believed: a place (half of a standard
# deviation is left), a change, which is noisier, a place whose scale and origin are free as well;
# and one that bears the name of what it commands.
EXPLAINED, CHANGED, RESCALED, NAMED = 0.75, 0.5, 0.8, 0.5
# A place in its own unit may look like a change (a fast target leads its response by a quarter
# turn), but where a change leaves this share of what the place leaves, and that is no rounding.
FAR_BETTER, LITTLE_LEFT = 0.2, 0.05
# A place in its own unit stays one, unless with a free gain it explains so much more.
SCALED_LEAD = 0.1
# A gain within these is one: what follows late or softly.
SAME_SCALE = (0.7, 1.4)
# Ties are broken by where numbers lie, by names, and by their order, in shares of the motion.
NEAR_BONUS, NAME_BONUS, ORDER_BONUS = 0.05, 0.03, 0.01
# A number that tells of nothing but the rate of another one, by so much and with such a gain.
RATE_OF, EXACT = 0.9, (0.8, 1.25)
# Fewer pairs than this share of the numbers that vary are not what the action is about.
LEAST_PAIRED = 0.25
# Factors between units that people confuse (m, cm, mm, inch, degree), and how well they are met.
UNIT_FACTORS = (1000.0, 100.0, 10.0, 180.0 / np.pi, 25.4, 2.54)
UNIT_TOLERANCE = 0.02
# Rows that an echo of the command repeats.
ECHOES = 0.9


@dataclass(frozen=True)
class Reading:
    """What the numbers of a sample say of the action.

    Attributes:
        pairs: Commanded number to the observed one that it commands.
        forms: Form of each commanded number. Length D_a.
        by_name: The pairs whose names say the same.
        contradicted: Commanded numbers whose observed namesake answers another one, while names
            stand: (commanded, the one that its namesake answers).
        strangers: Commanded numbers that do not move what bears their name.
    """

    pairs: dict[int, int]
    forms: tuple[CommandForm, ...]
    by_name: frozenset[int] = frozenset()
    contradicted: tuple[tuple[int, int], ...] = ()
    strangers: tuple[int, ...] = field(default=())


@dataclass(frozen=True)
class _Evidence:
    """All pairs under the three readings, and what ties are broken by. Shapes (D_a, D_o)."""

    same: Following
    scaled: Following
    change: Following
    near: Array
    two_valued: Flags

    def without(self, pairs: Flags) -> "_Evidence":
        """The same, with nothing to be said for some pairs."""
        none = [
            replace(found, explained=np.where(pairs, -np.inf, found.explained))
            for found in (self.same, self.scaled, self.change)
        ]
        return replace(self, same=none[0], scaled=none[1], change=none[2])

    def change_holds(self) -> Flags:
        """Where the change follows the command, beyond what any episode's would explain."""
        return (self.change.explained >= CHANGED) & self.change.beyond

    def scaled_holds(self) -> Flags:
        """Where a place in another unit, or from another origin, explains nearly all."""
        enough = (self.scaled.explained >= RESCALED) & self.scaled.beyond
        return enough & ~self.two_valued[:, None]

    def is_change(self) -> Flags:
        """Which of the two it is, where it could be either."""
        place = np.where(self.scaled_holds(), self.scaled.explained, self.same.explained)
        better = self.change.explained > np.maximum(place, self.same.explained)
        return self.change_holds() & better & ~self.surely_place()

    def surely_place(self) -> Flags:
        """Where a number comes back about the same place, and no change explains far more."""
        left = 1.0 - self.same.explained
        changed = np.where(self.change_holds(), 1.0 - self.change.explained, np.inf)
        far_better = changed.min(axis=1, keepdims=True) <= FAR_BETTER * left
        surely: Flags = (self.same.explained >= EXPLAINED) & (self.near > 0.0)
        return np.asarray(surely & ~(far_better & (left > LITTLE_LEFT)))


def read_forms(
    observed: Array,
    commanded: Array,
    episode: Integers,
    *,
    named: dict[int, int],
    period_s: float,
    no_partner: Sequence[int] = (),
) -> Reading:
    """Pairs and forms of the commanded numbers.

    Args:
        observed: Numbers that may be commanded, dataset units. Shape (n, D_o).
        commanded: Shape (n, D_a).
        episode: Which episode each row belongs to, grouped. Shape (n,).
        named: Commanded to observed number of the same name.
        period_s: Time between two rows, s.
        no_partner: Observed numbers that nothing commands by itself (parts of a rotation).
    """
    plain = tuple(CommandForm() for _ in range(commanded.shape[1]))
    if len(observed) < MINIMUM_SAMPLES:
        return Reading(dict(named), plain, frozenset(named))
    moves = varies(commanded)
    observed = observed.copy()
    observed[:, list(no_partner)] = 0.0
    evidence = _evidence(observed, commanded, episode)
    # What is one number in an episode is a goal or a cue, and answers nothing that moves in it.
    still = _stands(observed, episode)[None, :] & ~_stands(commanded, episode)[:, None]
    evidence = evidence.without(still | _flags(observed, evidence, named))
    score = _score(evidence)
    score[~moves] = -np.inf
    score[:, ~varies(observed)] = -np.inf
    _forget_rates(score, evidence, (observed, commanded), episode, period_s)
    # Its own unit and its own place are a simpler reading than any gain or derivative of others.
    simple: Flags = np.asarray(np.isfinite(score) & evidence.surely_place())
    score[np.any(simple, axis=1, keepdims=True) & ~simple] = -np.inf
    found = _assigned(score, evidence, named)
    pairs, contradicted, strangers = _with_names(found, named, evidence, moves)
    forms = [
        _form(
            evidence,
            a,
            found.get(a, pairs.get(a)),
            named=a in pairs and named.get(a) == pairs[a],
            moves=bool(moves[a]),
            values=(observed, commanded),
            period_s=period_s,
        )
        for a in range(commanded.shape[1])
    ]
    if len(pairs) < LEAST_PAIRED * np.count_nonzero(moves):
        pairs = {}
    same = frozenset(a for a, o in pairs.items() if named.get(a) == o)
    return Reading(pairs, tuple(forms), same, contradicted, strangers)


def _flags(observed: Array, evidence: _Evidence, named: dict[int, int]) -> Flags:
    """Pairs of a flag, mostly down where a small command is, and more than two values."""
    apart = np.array([[is_two_valued(v) for v in observed.T]]) & ~evidence.two_valued[:, None]
    apart[list(named), list(named.values())] = False
    return np.asarray(apart)


def _stands(values: Array, episode: Integers) -> Flags:
    """Columns that are one number, and its rounding, in every episode. Shape (D,)."""
    edges = np.flatnonzero(np.diff(episode, prepend=episode[0] - 1))
    moves = [varies(part) for part in np.split(values, edges[1:])]
    return np.asarray(~np.any(moves, axis=0))


def _evidence(observed: Array, commanded: Array, episode: Integers) -> _Evidence:
    with np.errstate(over="ignore", invalid="ignore"):
        width = observed.std(axis=0) + commanded.std(axis=0)[:, None]
        gap = np.abs(np.median(observed, axis=0) - np.median(commanded, axis=0)[:, None])
        near = np.where(width > 0.0, np.clip(1.0 - gap / np.where(width > 0, width, 1.0), 0, 1), 0)
    same = places(observed, commanded, episode, gain=1.0)
    held = levels(observed, commanded, episode)
    return _Evidence(
        same=replace(same, explained=np.maximum(same.explained, held)),
        scaled=places(observed, commanded, episode),
        change=changes(observed, commanded, episode),
        near=np.nan_to_num(near),
        two_valued=np.array([is_two_valued(values) for values in commanded.T], dtype=bool),
    )


def _score(evidence: _Evidence) -> Array:
    """Share of the motion that the best reading of a pair explains; -inf where none holds."""
    parts = (
        np.where(evidence.same.explained >= EXPLAINED, evidence.same.explained, -np.inf),
        np.where(evidence.scaled_holds(), evidence.scaled.explained, -np.inf),
        np.where(evidence.change_holds(), evidence.change.explained, -np.inf),
    )
    return np.asarray(np.maximum.reduce(parts))


def _forget_rates(
    score: Array,
    evidence: _Evidence,
    values: tuple[Array, Array],
    episode: Integers,
    period_s: float,
) -> None:
    """A rate that is commanded follows the measured rate as a place, and the last command itself.

    It is there to move what has that rate. A rate is known by its gain, the period or one; an echo
    of the command by its bits.
    """
    observed, commanded = values
    held = evidence.change_holds() & np.isfinite(score)
    for a in np.flatnonzero(held.any(axis=1)):
        base = int(np.argmax(np.where(held[a], evidence.change.explained[a], -np.inf)))
        for o in np.flatnonzero(np.isfinite(score[a])):
            if o == base:
                continue
            found = changes(observed[:, [base]], observed[:, [o]], episode)
            gain = float(found.gain[0, 0])
            sized = any(EXACT[0] <= gain / one <= EXACT[1] for one in (period_s, 1.0))
            told = found.explained[0, 0] >= RATE_OF and sized
            surely = evidence.change.explained[a, base] >= RATE_OF
            if told or (surely and _is_echo(observed[:, o], commanded[:, a], episode)):
                score[a, o] = -np.inf


def _is_echo(observed: Array, commanded: Array, episode: Integers) -> bool:
    """Whether the observed number repeats the command, bit by bit, at most two rows later."""
    for lag in range(3):
        same = episode[lag:] == episode[: len(episode) - lag]
        repeats = observed[lag:] == commanded[: len(commanded) - lag]
        if np.mean(repeats[same]) >= ECHOES:
            return True
    return False


def _assigned(score: Array, evidence: _Evidence, named: dict[int, int]) -> dict[int, int]:
    """All pairs at once, so that no number takes the partner of another."""
    bonus = NEAR_BONUS * np.where(evidence.is_change(), 1.0, evidence.near)
    for a, o in named.items():
        bonus[a, o] += NAME_BONUS
    order = [np.arange(n) / max(n - 1, 1) for n in score.shape]
    bonus = bonus - ORDER_BONUS * np.abs(order[0][:, None] - order[1])
    # What holds always outweighs what does not: a pair is worth 1 and what it explains.
    worth = np.where(np.isfinite(score), 1.0 + score + bonus, 0.0)
    rows, columns = linear_sum_assignment(-worth)
    return {int(a): int(o) for a, o in zip(rows, columns, strict=True) if worth[a, o] > 0.0}


def _with_names(
    found: dict[int, int], named: dict[int, int], evidence: _Evidence, moves: Flags
) -> tuple[dict[int, int], tuple[tuple[int, int], ...], tuple[int, ...]]:
    """The pairs, where names stand against the numbers, and where they do not hold."""
    circle = _circle(found, named)
    owner = {o: a for a, o in named.items()}
    pairs = {a: named[a] if a in circle else o for a, o in found.items()}
    taken, strangers = set(pairs.values()), []
    follows = np.maximum(evidence.same.explained, evidence.scaled.explained)
    for a, o in named.items():
        if a in pairs or not moves[a]:
            if a in pairs and pairs[a] != o:
                strangers.append(a)
            continue
        # A weak follower that bears the name may be a faulty one, which the audit shall see.
        if o not in taken and follows[a, o] >= NAMED:
            pairs[a] = o
            taken.add(o)
        else:
            strangers.append(a)
    return (
        dict(sorted(pairs.items())),
        tuple((a, owner[found[a]]) for a in sorted(circle)),
        tuple(sorted(strangers)),
    )


def _circle(found: dict[int, int], named: dict[int, int]) -> set[int]:
    """Commanded numbers that exchange their namesakes among themselves."""
    circle = {a for a, o in found.items() if a in named and named[a] != o}
    while True:
        namesakes = {named[a] for a in circle}
        answered = {found[a] for a in circle}
        kept = {a for a in circle if found[a] in namesakes and named[a] in answered}
        if kept == circle:
            return circle
        circle = kept


def _form(
    evidence: _Evidence,
    a: int,
    partner: int | None,
    *,
    named: bool,
    moves: bool,
    values: tuple[Array, Array],
    period_s: float,
) -> CommandForm:
    """How the command moves what answers it; a sign or a unit against the names is kept."""
    if partner is None:
        held = np.flatnonzero(evidence.change_holds()[a])
        if not len(held):
            known = evidence.two_valued[a] or not moves
            return CommandForm(form="place" if known else "unknown")
        partner = int(held[np.argmax(evidence.change.explained[a, held])])
    if evidence.is_change()[a, partner]:
        gain = float(evidence.change.gain[a, partner])
        gain = abs(gain) if named else gain
        return added_up(gain, period_s)
    same, scaled = evidence.same.explained[a, partner], evidence.scaled.explained[a, partner]
    if same >= max(EXPLAINED, scaled - SCALED_LEAD) or not evidence.scaled_holds()[a, partner]:
        return CommandForm()
    observed, commanded = values
    gain = _rounded(float(evidence.scaled.gain[a, partner]))
    if named and _is_mistake(gain):
        return CommandForm()
    offset = float(np.median(observed[:, partner]) - gain * np.median(commanded[:, a]))
    return CommandForm(gain=gain, offset=_rounded(offset))


def _is_mistake(gain: float) -> bool:
    """Whether a gain under one name is a sign or a unit: then the audit shall find it."""
    size = abs(np.log(abs(gain))) if gain else np.inf
    known = [abs(size - np.log(factor)) <= UNIT_TOLERANCE for factor in UNIT_FACTORS]
    return gain < 0.0 or any(known)


def added_up(gain: float, period_s: float) -> CommandForm:
    """A rate where one of it moves by the period in a row; else a change, maybe normalised."""
    is_change = SAME_SCALE[0] <= abs(gain) <= SAME_SCALE[1]
    is_rate = SAME_SCALE[0] <= abs(gain) / period_s <= SAME_SCALE[1]
    return CommandForm(form="rate" if is_rate and not is_change else "change", gain=_rounded(gain))


def _rounded(value: float) -> float:
    return float(f"{value:.6g}")
