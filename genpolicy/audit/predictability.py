"""How much of the mode can be told from what the policy does not see? On held-out episodes.

The strata ask whether a variable explains the modes beyond chance. This asks how often it tells
them: from recorded variables, from the order of recording, and from the past. Each is judged on
episodes that were left out when it was learned, as the share of wrong guesses that it takes away:
0 is a guess, 1 is certainty. Of two even modes, 0.4 is 7 right of 10.
"""

from collections import Counter
from dataclasses import replace

import numpy as np
from scipy import stats

from genpolicy.audit.before import Before, seen_before
from genpolicy.audit.choices import Choices, choices
from genpolicy.audit.columns import COLUMNS, column_guesses
from genpolicy.audit.data import Array, AuditInput, Integers, Text, recorded
from genpolicy.audit.guesses import (
    Guess,
    by_all,
    by_best_column,
    by_nearest,
    by_one_more,
    by_value,
    right,
)
from genpolicy.audit.modes import Clustering
from genpolicy.audit.neighbourhoods import Neighbourhood
from genpolicy.audit.rows import Prediction
from genpolicy.audit.settings import AuditSettings
from genpolicy.audit.situations import Several
from genpolicy.audit.stored import sequence_hits
from genpolicy.audit.variable import EPISODE_VARIABLES
from genpolicy.seeds import stream

REPEATS = 5
LEAST_EPISODES = 20
NOTHING_BEFORE = "the choice is at the start: nothing was seen before it"
ORDER, SEQUENCE, HISTORY, TOGETHER = (
    "episode_order", "recording_sequence", "history", "everything_together",
)  # fmt: skip
HABIT, OWN_HABIT, TURNS = (
    "previous_episodes", "previous_episodes_of_operator", "every_other_episode",
)  # fmt: skip
Items = list[tuple[Neighbourhood, Clustering]]
NEXT_TO = 4  # episodes recorded next to one another that speak for each other
HABIT_LENGTH = 2
# Of what the present tells, no more than this is taken for granted: something must be left to tell.
MOST_SEEN = 0.9


def predictions(
    data: AuditInput,
    settings: AuditSettings,
    situations: Several,
    links: dict[str, Integers],
    *,
    root_seed: int,
) -> tuple[Prediction, ...]:
    """What each recorded variable, the order and the past tell of the modes of every phase.

    Args:
        data: Canonical audit input.
        settings: Horizons and confidence.
        situations: Situations with several modes, per phase.
        links: Mode of each episode, -1 for none, per phase. Shape (E,).
        root_seed: Seed of the folds.

    Returns:
        One row per variable and phase; a variable that was not recorded, or has one value only, has
        none, and too few episodes leave an interval from below chance to certainty.
    """
    rows: list[Prediction] = []
    keys = {item.name: item.key for item in data.variables}
    for phase, items in sorted(situations.items()):
        chosen = choices(data, items, links[phase])
        codes = _codes(data, chosen, links, phase)
        guesses: dict[str, Guess] = {name: by_value(values) for name, values in codes.items()}
        partly = _partly_known(data, chosen, links, phase)
        columns = [
            _one_hot(values) for values in (*codes.values(), _cells(codes, len(chosen.mode)))
        ]
        order = data.episodes.order
        if len(chosen.episode) and np.all(np.isfinite(order)):
            place = _rank(order)[chosen.episode].astype(np.float64)
            middle = np.abs(place - place.mean())
            guesses[ORDER] = by_best_column(np.stack([place, middle], axis=1))
            guesses[SEQUENCE] = by_nearest(place, NEXT_TO)
            columns.append(place[:, None])
        more, numbers, times = column_guesses(data, chosen, _rows_of(items))
        guesses |= more
        columns += numbers
        if len(guesses) > 1:
            guesses[TOGETHER] = by_all(np.concatenate(columns, axis=1))
        for name, guess in guesses.items():
            once = name in (TOGETHER, COLUMNS)
            rng = stream(root_seed, "audit", "predictability", phase, keys.get(name, name))
            hits = _hits(chosen, guess, rng, repeats=1 if once else REPEATS)
            of = len(more) if name in keys else 1
            row = _row(name, phase, chosen, hits, settings.confidence, of=of)
            if name in partly:
                row = denied_where_known(row, chosen, partly[name], rng, settings.confidence)
            rows.append(replace(row, detail=_best(times)) if name == COLUMNS else row)
        rows = _with_turns(data, rows, (phase, chosen), root_seed, settings.confidence)
        seen = seen_before(data, settings, items, chosen)
        if len(seen.choices.mode) >= LEAST_EPISODES:
            rng = stream(root_seed, "audit", "predictability", phase, HISTORY)
            rows.append(_past(phase, seen, rng, settings.confidence))
        elif seen.reached == 0 and len(chosen.mode) >= LEAST_EPISODES:
            rows.append(_no_past(phase, chosen))
    return tuple(rows)


def _hits(chosen: Choices, guess: Guess, rng: np.random.Generator, *, repeats: int) -> Array:
    if len(chosen.mode) < LEAST_EPISODES:
        return np.full(len(chosen.mode), chosen.chance)
    return right(chosen, guess, rng, repeats=repeats)


def _codes(
    data: AuditInput, chosen: Choices, links: dict[str, Integers], phase: str
) -> dict[str, Integers]:
    """Values of everything with few values, by name, of the episodes that chose; two at least."""
    table, episode = data.episodes, chosen.episode
    found: dict[str, Integers] = {}
    for name in EPISODE_VARIABLES:
        values = getattr(table, name)
        if recorded(values):
            found[name] = _numbered(values[episode])
    if np.all(np.isfinite(table.order)):
        found[TURNS] = (_rank(table.order) % 2)[episode]
        found[HABIT] = _before(links[phase], table.order, np.zeros(len(table), np.int64))[episode]
        if recorded(table.operator):
            own = _before(links[phase], table.order, _numbered(table.operator))
            found[OWN_HABIT] = own[episode]
    for other in sorted(links):
        if other != phase and _begins(data, other) < _begins(data, phase):
            found[f"mode_of_{other}"] = links[other][episode] + 1
    return {name: values for name, values in found.items() if len(np.unique(values)) > 1}


def _partly_known(
    data: AuditInput, chosen: Choices, links: dict[str, Integers], phase: str
) -> dict[str, Integers]:
    """Modes of other episodes or phases that are not known of every episode, -1 there; by name."""
    table, own = data.episodes, links[phase]
    found = {f"mode_of_{other}": links[other][chosen.episode] for other in links if other != phase}
    if np.all(np.isfinite(table.order)):
        found[HABIT] = _just_before(own, table.order, np.zeros(len(table), np.int64))
        found[OWN_HABIT] = _just_before(own, table.order, _numbered(table.operator))
        found |= {name: found[name][chosen.episode] for name in (HABIT, OWN_HABIT)}
    return found


def denied_where_known(
    row: Prediction, chosen: Choices, told_by: Integers, rng: np.random.Generator, confidence: float
) -> Prediction:
    """The row with the upper end of those episodes of which what tells is known.

    A guess at the others is worth nothing. Whoever counts them takes what nobody could see for
    proof that there is nothing: of habits exactly at the limit a fifth was denied at a confidence
    of .95.

    Args:
        row: What was told of all.
        chosen: Episodes that had a choice.
        told_by: What tells, -1 where it is not known. Shape (n,).
        rng: Of the folds.
        confidence: Of the end.
    """
    known = told_by >= 0
    part = Choices(chosen.episode[known], chosen.mode[known], chosen.share[known])
    hits = _hits(part, by_value(told_by[known]), rng, repeats=REPEATS)
    upper = _row(row.variable, row.phase, part, hits, confidence).told_upper
    return replace(row, told_upper=max(row.told_upper, upper))


def _cells(codes: dict[str, Integers], n: int) -> Integers:
    """Every combination of the recorded variables as a value of its own (n,)."""
    cell = np.zeros(n, dtype=np.int64)
    for name in EPISODE_VARIABLES:
        if name in codes:
            cell = cell * (int(codes[name].max()) + 1) + codes[name]
    return cell


def _begins(data: AuditInput, phase: str) -> float:
    rows = data.index[data.grouping == phase]
    return float(np.median(rows)) if len(rows) else np.inf


def _rank(order: Array) -> Integers:
    """Place in the order of recording. Shape (E,)."""
    return np.argsort(np.argsort(order, kind="stable"), kind="stable")


def _before(links: Integers, order: Array, group: Integers) -> Integers:
    """Modes of the episodes just before each in its group, as one number; 0 for none (E,)."""
    result = np.zeros(len(links), dtype=np.int64)
    kinds = int(links.max(initial=-1)) + 2
    for name in np.unique(group):
        last = [0] * HABIT_LENGTH
        for episode in np.argsort(order, kind="stable"):
            if group[episode] != name:
                continue
            result[episode] = sum(mode * kinds**back for back, mode in enumerate(last))
            if links[episode] >= 0:
                last = [int(links[episode]) + 1, *last[:-1]]
    return result


def _just_before(links: Integers, order: Array, group: Integers) -> Integers:
    """Mode of the very episode before each in its group; -1 for none (E,)."""
    result = np.full(len(links), -1, dtype=np.int64)
    for name in np.unique(group):
        inside = np.flatnonzero(group == name)
        inside = inside[np.argsort(order[inside], kind="stable")]
        result[inside[1:]] = links[inside[:-1]]
    return result


def _with_turns(
    data: AuditInput,
    rows: list[Prediction],
    of: tuple[str, Choices],
    root_seed: int,
    confidence: float,
) -> list[Prediction]:
    """What the sequence tells by a pattern over all starts, in place of less that it tells by name.

    What decided shows in an episode and in its neighbour alike: a neighbour that tells a quarter
    shows something that tells a half, at least. How much it tells at most no neighbour says, so
    nothing is denied beside a pattern; one that is not believed accuses nobody: its lower end is
    that of a guess.
    """
    phase, chosen = of
    ordered = bool(np.all(np.isfinite(data.episodes.order)))
    place = data.episodes.order if ordered else data.stored
    if place is None or len(chosen.mode) < LEAST_EPISODES:
        return rows
    found = sequence_hits(data, place, chosen, seeds=(root_seed, phase))
    if found is None:
        return rows
    *hits, believed = found
    row, nearest = (_row(SEQUENCE, phase, chosen, part, confidence) for part in hits)
    ends = [nearest.told, nearest.told_lower, nearest.told_upper]
    told, lower, upper = (float(np.sqrt(max(end, 0.0))) for end in ends)
    # Where the order is known it is asked by itself, and a share that drifts is no session.
    if lower > row.told_lower and not ordered:
        row = replace(row, told=told, told_lower=lower, told_upper=upper)
    least = row.told_lower if believed else min(row.told_lower, 0.0)
    row = replace(row, told_lower=least, told_upper=1.0)
    same = [old for old in rows if (old.variable, old.phase) == (SEQUENCE, phase)]
    if same and same[0].told_lower >= row.told_lower:
        return rows
    return [*(old for old in rows if old not in same), row]


def _no_past(phase: str, chosen: Choices) -> Prediction:
    by_luck, n = chosen.chance, len(chosen.mode)
    return Prediction(HISTORY, phase, 0.0, 0.0, 0.0, by_luck, by_luck, n, NOTHING_BEFORE)


def _past(phase: str, seen: Before, rng: np.random.Generator, confidence: float) -> Prediction:
    """What was seen earlier in the episode tells, beyond what is seen now.

    Where the ways have begun to part, the present tells of the choice by its consequence, and hides
    what a cue told before. So the past is asked by itself as well: a little beyond the present
    proves nothing against a past that by itself may tell too much.
    """
    guesses = (
        by_best_column(seen.present),
        by_one_more(seen.present, seen.past),
        by_best_column(seen.past),
    )
    now, both, alone = (
        _row(HISTORY, phase, seen.choices, _hits(seen.choices, guess, rng, repeats=1), confidence)
        for guess in guesses
    )
    known = min(now.told, MOST_SEEN)
    ends = (both.told, both.told_lower, both.told_upper)
    middle, lower, upper = ((end - known) / (1.0 - known) for end in ends)
    return replace(both, told=middle, told_lower=lower, told_upper=max(upper, alone.told_upper))


def _rows_of(items: Items) -> Integers:
    """Every row of the situations, each once."""
    members = [situation.members for situation, _ in items]
    return np.unique(np.concatenate(members)) if members else np.zeros(0, dtype=np.int64)


def _best(times: Counter[str]) -> str:
    """The column that was most often the best one."""
    return min(times, key=lambda name: (-times[name], name)) if times else ""


def _row(
    variable: str, phase: str, chosen: Choices, hits: Array, confidence: float, *, of: int = 1
) -> Prediction:
    """Share of right guesses with an interval for weighted shares. Source: Korn, Graubard 1998.

    Each end is a bound at the confidence: a verdict rests on one of them, never on both.
    Whoever is misled by a variable would not use it: no share is less than that of a guess. Of
    several variables of one kind (`of`) all intervals hold at once (Bonferroni).
    """
    weight, chance = chosen.weight, chosen.chance
    n = len(weight)
    if n < LEAST_EPISODES:
        low = -chance / max(1.0 - chance, 1e-12)
        return Prediction(variable, phase, 0.0, low, 1.0, chance, chance, n, "too few episodes")
    share = max(float(weight @ hits / weight.sum()), chance)
    effective = float(weight.sum() ** 2 / np.sum(weight**2))
    k, tail = share * effective, (1.0 - confidence) / of
    low = float(stats.beta.ppf(tail, k, effective - k + 1.0)) if k > 0.0 else 0.0
    high = float(stats.beta.isf(tail, k + 1.0, effective - k)) if k < effective else 1.0
    told, lower, upper = ((x - chance) / (1.0 - chance) for x in (share, low, high))
    return Prediction(variable, phase, told, lower, upper, share, chance, n)


def _numbered(values: Integers | Text) -> Integers:
    return np.asarray(np.unique(values, return_inverse=True)[1].reshape(-1), dtype=np.int64)


def _one_hot(values: Integers) -> Array:
    return np.asarray(values[:, None] == np.unique(values)[None], dtype=np.float64)
