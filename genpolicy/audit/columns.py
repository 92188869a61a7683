"""Does any recorded column decide the modes? Each is tested, and each guesses at left-out episodes.

However many columns there are, they are one question: whether the best of them tells the modes. So
that best one is chosen anew without the episodes that it is then held against (nested
cross-validation), and by itself a column is believed only at the level that all of them share.
"""

from collections import Counter
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from genpolicy.audit.choices import Choices
from genpolicy.audit.data import Array, AuditInput, Flags, Integers
from genpolicy.audit.guesses import Guess
from genpolicy.audit.rows import Stratum
from genpolicy.audit.settings import AuditSettings
from genpolicy.audit.variable import INSIDE, Values, Variable
from genpolicy.seeds import stream
from genpolicy.statistics.conditional import ConditionalTest, conditional_test

COLUMNS = "recorded_columns"
BINS = 3
NEAREST = 4
# A first look that stops where nothing is to be seen; what goes on is tested with new draws, so
# that neither look makes a false finding more likely than the level.
FIRST_LOOK, GO_ON = 199, 0.2
INNER_FOLDS = 5
# The observation tells a column's values apart where it does so in most situations.
MOST = 0.5
LEAST_APART = 3
Drawn = tuple[Integers, Integers, Integers]
Knows = Callable[[Choices, Flags, Flags], Array]
"""Scores of each mode: choices, which are known, which are wanted -> (wanted, K)."""


@dataclass(frozen=True)
class Asking:
    """The phase asked about and the seed."""

    phase: str
    root_seed: int


def column_strata(
    data: AuditInput, settings: AuditSettings, drawn: Drawn, asking: Asking
) -> list[Stratum]:
    """Each recorded column against the modes of one phase, inside situations.

    Args:
        data: Canonical audit input.
        settings: Permutations; what tells two observations apart.
        drawn: Rows, modes and situation of rows of different episodes. Shapes (n,).
        asking: Phase and seed.

    Returns:
        One row per column, not yet adjusted.
    """
    rows, labels, blocks = drawn
    result = []
    for item in data.variables:
        values = binned(item.at(rows, data.episode[rows]), blocks)
        rng = stream(asking.root_seed, "audit", "strata", asking.phase, item.key)
        test = _tested(labels, values, blocks, settings.permutations, rng)
        result.append(
            Stratum(
                variable=item.name,
                phase=asking.phase,
                p_value=test.p_value,
                p_adjusted=None,
                effect=test.effect,
                effect_lower=test.effect_lower,
                effect_upper=test.effect_upper,
                n=test.n,
                recorded=True,
                observed=_is_seen(data, settings, (rows, values, blocks)),
                detail=_words(item),
            )
        )
    return result


def _words(item: Variable) -> str:
    also = [f"the same as {', '.join(item.also)}"] if item.also else []
    return "; ".join([*also, INSIDE] if item.by_row else also)


def column_guesses(
    data: AuditInput, chosen: Choices, rows: Integers
) -> tuple[dict[str, Guess], list[Array], Counter[str]]:
    """A guess from each recorded column, and one from the best of them.

    Args:
        data: Canonical audit input.
        chosen: Episodes that had a choice.
        rows: Rows in which they had it.

    Returns:
        Guesses by name, the columns as numbers for a tree over all, and how often each column was
        the best one, counted while the guess is made.
    """
    times: Counter[str] = Counter()
    values = {item.name: _of_episodes(data, item, chosen, rows) for item in data.variables}
    values = {name: part for name, part in values.items() if len(np.unique(part)) > 1}
    knows = {name: _knowing(part) for name, part in values.items()}
    guesses: dict[str, Guess] = {name: _as_guess(know) for name, know in knows.items()}
    if len(knows) > 1:
        guesses[COLUMNS] = _as_guess(_best_of(knows, times))
    return guesses, [_numbers(part) for part in values.values()], times


def binned(values: Values, blocks: Integers) -> Integers:
    """Thirds of a measure inside each block, not recorded apart; groups as they are. Shape (n,)."""
    if values.dtype.kind != "f":
        return np.asarray(values, dtype=np.int64)
    result = np.full(len(values), BINS, dtype=np.int64)
    for block in np.unique(blocks):
        inside = np.flatnonzero((blocks == block) & np.isfinite(values))
        if len(inside):
            cuts = np.quantile(values[inside], np.arange(1, BINS) / BINS)
            result[inside] = np.searchsorted(cuts, values[inside], side="left")
    return result


def _tested(
    labels: Integers, values: Integers, blocks: Integers, draws: int, rng: np.random.Generator
) -> ConditionalTest:
    first = conditional_test(labels, values, blocks, rng=rng, permutations=min(FIRST_LOOK, draws))
    if first.p_value > GO_ON or draws <= FIRST_LOOK:
        return first
    return conditional_test(labels, values, blocks, rng=rng, permutations=draws)


def _is_seen(data: AuditInput, settings: AuditSettings, drawn: Drawn) -> bool:
    """Whether one observed component tells the values apart, by more than its scale.

    It must do so in most of the situations that hold several values: then a policy sees them.
    """
    rows, values, blocks = drawn
    used = np.flatnonzero(np.isfinite(data.observation_scale))
    told, asked = 0, 0
    for block in np.unique(blocks):
        inside = blocks == block
        kinds, counts = np.unique(values[inside], return_counts=True)
        large = kinds[counts >= LEAST_APART]
        if len(large) < 2:
            continue
        asked += 1
        seen = data.observation[np.ix_(rows[inside], used)] / data.observation_scale[used]
        told += all(_apart(seen, values[inside] == kind, settings.resolved_auc) for kind in large)
    return asked > 0 and told > MOST * asked


def _apart(seen: Array, inside: Flags, least: float) -> bool:
    """Whether a component parts the members from the rest (nearly) perfectly and by a scale."""
    gap = np.abs(np.median(seen[inside], axis=0) - np.median(seen[~inside], axis=0))
    for column in np.flatnonzero(gap >= 1.0):
        pairs = seen[inside, column][:, None] - seen[~inside, column][None]
        share = float(np.mean((pairs > 0) + 0.5 * (pairs == 0)))
        if max(share, 1.0 - share) >= least:
            return True
    return False


def _of_episodes(data: AuditInput, item: Variable, chosen: Choices, rows: Integers) -> Values:
    """Value of each episode that chose: where it switches, the one most rows of its choices had."""
    if not item.by_row:
        return item.values[chosen.episode]
    episode, values = data.episode[rows], item.values[rows]
    empty: Values = np.full(len(chosen.episode), np.nan)
    result = empty if item.is_measure else np.full(len(chosen.episode), -1, dtype=np.int64)
    for place, number in enumerate(chosen.episode):
        part = values[episode == number]
        if len(part):
            kinds, counts = np.unique(part, return_counts=True)
            result[place] = kinds[np.argmax(counts)]
    return result


def _knowing(values: Values) -> Knows:
    return _by_measure(values) if values.dtype.kind == "f" else _by_group(values)


def _by_group(values: Values) -> Knows:
    """How often each mode was seen under the value."""
    codes = np.unique(values, return_inverse=True)[1].reshape(-1)
    kinds = int(codes.max()) + 1

    def knows(choices: Choices, known: Flags, wanted: Flags) -> Array:
        table = np.zeros((kinds, choices.share.shape[1]))
        np.add.at(table, (codes[known], choices.mode[known]), choices.weight[known])
        return np.asarray(table[codes[wanted]] / np.maximum(table.sum(axis=0), 1e-12))

    return knows


def _by_measure(values: Values) -> Knows:
    """Modes of the known episodes with the nearest values; nothing where it was not recorded."""

    def knows(choices: Choices, known: Flags, wanted: Flags) -> Array:
        modes = choices.share.shape[1]
        usable = np.flatnonzero(known & np.isfinite(values))
        result = np.zeros((int(np.count_nonzero(wanted)), modes))
        if not len(usable):
            return result
        usable = usable[np.argsort(values[usable], kind="stable")]
        one = np.zeros((len(usable), modes))
        one[np.arange(len(usable)), choices.mode[usable]] = choices.weight[usable]
        own = values[wanted]
        has = np.flatnonzero(np.isfinite(own))
        at = np.searchsorted(values[usable], own[has])
        window = at[:, None] + np.arange(-NEAREST, NEAREST)
        inside = (window >= 0) & (window < len(usable))
        window = np.clip(window, 0, len(usable) - 1)
        gaps = np.where(inside, np.abs(values[usable][window] - own[has][:, None]), np.inf)
        near = np.argsort(gaps, axis=1, kind="stable")[:, :NEAREST]
        counted = np.take_along_axis(inside, near, axis=1)[..., None]
        votes = one[np.take_along_axis(window, near, axis=1)] * counted
        result[has] = votes.sum(axis=1) / np.maximum(one.sum(axis=0), 1e-12)
        return result

    return knows


def _best_of(knows: dict[str, Knows], times: Counter[str]) -> Knows:
    """What the column tells that guesses best among the known episodes themselves."""

    def best(choices: Choices, known: Flags, wanted: Flags) -> Array:
        places = np.flatnonzero(known)
        folds = np.full(len(known), -1)
        folds[places] = np.arange(len(places)) % min(INNER_FOLDS, len(places))
        scores = {name: _inner(choices, know, folds) for name, know in knows.items()}
        name = max(scores, key=lambda key: scores[key])
        times[name] += 1
        return knows[name](choices, known, wanted)

    return best


def _inner(choices: Choices, know: Knows, folds: Integers) -> float:
    """Weighted share of right guesses at known episodes, each left out in turn."""
    total = 0.0
    for number in range(int(folds.max()) + 1):
        held = folds == number
        scores = know(choices, (folds >= 0) & ~held, held)
        total += float(choices.weight[held] @ hits(choices, held, scores))
    return round(total, 9)


def hits(choices: Choices, held: Flags, scores: Array) -> Array:
    """Share of a right guess of each held-out episode; ties share. Shape (held out,)."""
    allowed = choices.allowed[held]
    scores = np.where(allowed, scores, -np.inf)
    best = (scores >= scores.max(axis=1, keepdims=True) - 1e-9) & allowed
    own = best[np.arange(len(best)), choices.mode[held]]
    return np.asarray(own / np.maximum(best.sum(axis=1), 1))


def _as_guess(know: Knows) -> Guess:
    def guess(choices: Choices, held: Flags, seed: int) -> Array:
        return know(choices, ~held, held)

    return guess


def _numbers(values: Values) -> Array:
    """A column as numbers for a tree: a measure with its gaps filled, groups one by one."""
    if values.dtype.kind == "f":
        known = np.isfinite(values)
        filled = np.where(known, values, np.median(values[known]) if known.any() else 0.0)
        return np.stack([filled, known.astype(np.float64)], axis=1)
    return np.asarray(values[:, None] == np.unique(values)[None], dtype=np.float64)
