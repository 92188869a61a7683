"""Units: is the observed motion as large as the commanded one, and a value as large as its like?

Standard deviations inside an episode are compared, so that neither lag nor frame matters, where the
one follows the other. A factor that no arm produces is a unit; so is an epoch that answers by
another factor than the others. What stands, what is constant and what has length one has none.
"""

import numpy as np

from genpolicy.audit.data import Array, AuditInput, Flags, Integers
from genpolicy.audit.rows import Finding
from genpolicy.audit.semantics.directions import directional
from genpolicy.audit.semantics.following import Following
from genpolicy.audit.semantics.motion import Motion
from genpolicy.audit.semantics.report import listed
from genpolicy.audit.semantics.robust import (
    densest_half,
    episode_deviation,
    episode_medians,
    group_medians,
    some,
)
from genpolicy.audit.settings import AuditSettings

LEAST_EPISODES = 4
# Columns that move by less than this share of what columns usually move have no factor.
MATTERS = 0.1
# Correlation with its command from which a single column has a factor.
LIKE = 0.9
# Spread of the logarithms of what is one factor: a fourth either way.
ONE_FACTOR = 0.25
# Size and travel of a position say one factor within this.
SAME_FACTOR = 2.0
# The middle part of the way between two units, in logarithms, and how many may stand there, as a
# share of those beyond.
VALLEY, BETWEEN = 1.0 / 3.0, 0.1
# Shares of positive values may differ by this between two units.
SIGNS = 0.25
# Gains nearer to one are left in: where an episode ends before its last command is reached, the
# gain is a little too small, and taking that out would look like a lag that changes on the way.
TAKEN_OUT = 1.1
# Share of the components of a channel that have a unit and must agree about another one.
MOST = 0.5
# A factor between episodes may be one of units if it is also this many spreads...
MAGNITUDE_SPREADS = 8.0
# ...and if the scatter of the episodes is larger by that factor too, within this one, or rather so
# than as before: an object that stands elsewhere scatters as before, and the scatter of a few dozen
# episodes that do several things is known to no better than a factor of two or three.
SCATTER = 2.0
LEAST_SCATTER = 5
# Fewer episodes are a finding beyond this only.
LONE_MAGNITUDE = 100.0
# One episode is enough to be a finding where its gain is beyond this.
LONE_FACTOR = 10.0
FACTORS = (
    (1000.0, "m and mm"), (100.0, "m and cm"), (180.0 / np.pi, "degrees and radians"),
    (25.4, "inches and mm"), (10.0, "cm and mm"), (2.54, "inches and cm"),
)  # fmt: skip


def gain_findings(
    data: AuditInput, motion: Motion, found: Following, settings: AuditSettings
) -> tuple[list[Finding], Array]:
    """Factors between commanded and observed motion.

    Args:
        data: Canonical data.
        motion: Commanded and observed motion.
        found: How each column follows its command: where none does, there is no factor, and
            where one does there is, however small the motion is.
        settings: Limits.

    Returns:
        Findings, and the usual factor of each episode, which is taken out before clocks are
        measured. Shape (E,).
    """
    factors = np.ones(len(data.episodes))
    sized = ~motion.directional
    if not sized.any():
        return [], factors
    follows = found.follows[:, sized]
    asked = episode_deviation(motion.commanded[:, sized], motion.starts) * follows
    seen = episode_deviation(motion.observed[:, sized], motion.starts) * follows
    gains = log_gain(np.linalg.norm(seen, axis=1), np.linalg.norm(asked, axis=1))
    findings = _epochs(data, gains, "position", settings, factors)
    findings += _episodes(data, gains, "position", settings, factors)
    return findings, np.where(np.abs(np.log(factors)) > np.log(TAKEN_OUT), factors, 1.0)


def component_findings(
    data: AuditInput, motion: Motion, found: Following, settings: AuditSettings
) -> list[Finding]:
    """The same for single components, once no frame is turned and no column swapped.

    A factor is a unit only where it is one factor: a finger that is stopped by what it grasps
    follows by another one in each episode. A column that is commanded to hardly anything has no
    factor, and a tremor is answered by less than slow motion.
    """
    asked = mattering(data, motion)
    alike = np.maximum(found.positive, found.negative) >= LIKE
    with np.errstate(divide="ignore", invalid="ignore"):
        every = np.where(alike & found.slow, np.log(found.seen) - np.log(found.asked), np.nan)
    findings = []
    for column in np.flatnonzero(asked & ~motion.directional):
        name, gains = motion.names[column], every[:, column]
        known = np.isfinite(gains)
        if np.count_nonzero(known) < LEAST_EPISODES:
            continue
        whole: list[Finding] = []
        if densest_half(gains[known])[1] <= ONE_FACTOR:
            whole = _epochs(data, gains, name, settings, None)
        findings += whole or _episodes(data, gains, name, settings, np.ones(len(gains)))
    return findings


def mattering(data: AuditInput, motion: Motion) -> Flags:
    """Columns that move, commanded or observed, beside the others. Shape (P,)."""
    columns = np.arange(data.observation.shape[1])[data.observation_position]
    scale = data.observation_scale[columns[: len(motion.names)]]
    asked = episode_deviation(motion.commanded, motion.starts)
    seen = episode_deviation(motion.observed, motion.starts)
    size = np.median(np.maximum(asked, seen), axis=0) / np.where(np.isfinite(scale), scale, 1.0)
    usual = float(np.median(size[size > 0])) if (size > 0).any() else 0.0
    return np.asarray(size > MATTERS * usual)


def magnitude_findings(data: AuditInput, motion: Motion, settings: AuditSettings) -> list[Finding]:
    """Episodes whose positions or channels are larger or smaller than all others by a unit."""
    findings = []
    sized = ~motion.directional
    if sized.any():
        values = motion.commanded[:, sized]
        size = np.linalg.norm(episode_medians(np.abs(values), motion.starts), axis=1)
        travel = np.linalg.norm(episode_deviation(values, motion.starts), axis=1)
        both = np.stack([_off(size, settings), _off(travel, settings)])
        # Both must say one factor: a start elsewhere or an arm that stands is no unit.
        same = (both != 0.0).all(axis=0) & (np.sign(both[0]) == np.sign(both[1]))
        if same.any():
            apart = np.abs(np.median(both[0][same]) - np.median(both[1][same]))
            same &= bool(np.log(SAME_FACTOR) - apart >= 0)
        findings += _magnitude(data, "position", np.where(same, both[1], 0.0), settings)
    for name, part in data.context.items():
        findings += _magnitude(data, name, _channel(data, motion, part, settings), settings)
    return findings


def _channel(data: AuditInput, motion: Motion, part: slice, settings: AuditSettings) -> Array:
    """Logarithm of the factor by which a channel is off in each episode; 0 where it is not.

    Component by component: beside a direction cosine a length hardly counts. Directions, counters
    and constants have no unit that could be another; of those that have one most must agree, for
    a state of many numbers holds some that differ for reasons of their own.
    """
    values = data.observation[:, part]
    sized = ~directional(values) & ~_counting(values, motion.starts)
    medians = episode_medians(values[:, sized], motion.starts)
    off = [_off(column, settings) * _clear(column) for column in medians.T]
    asked = [row for row, column in zip(off, medians.T, strict=True) if _usual(np.abs(column))]
    if not asked:
        return np.zeros(len(data.episodes))
    table = np.stack(asked)
    agreed = np.count_nonzero(table, axis=0) >= MOST * len(table)
    worst = table[np.argmax(np.abs(table), axis=0), np.arange(table.shape[1])]
    return np.where(agreed, worst, 0.0)


def _counting(values: Array, starts: Integers) -> Flags:
    """Columns that only rise inside episodes: times and counters. Shape (D,)."""
    steps = np.diff(values, axis=0)
    inside = np.ones(len(steps), dtype=bool)
    edges = starts[1:-1] - 1
    inside[edges[(edges >= 0) & (edges < len(steps))]] = False
    steps = steps[inside]
    return np.asarray((steps >= 0).all(axis=0) & (steps > 0).any(axis=0))


def _usual(sizes: Array) -> bool:
    """Whether there is a usual size, and it is not one and the same number."""
    known = sizes[np.isfinite(sizes)]
    if len(known) < LEAST_EPISODES:
        return False
    centre, spread = densest_half(known)
    return 0.5 * centre - spread > 0 and spread > 1e-9 * centre


def _clear(values: Array) -> Array:
    """0 for small values of a component that lies about zero: there, small is no other unit."""
    about_zero = min(np.mean(values > 0), np.mean(values < 0)) > 0.05
    small = np.abs(values) <= np.quantile(np.abs(values), 0.5)
    return np.where(about_zero & small, 0.0, 1.0)


def log_gain(seen: Array, asked: Array) -> Array:
    """Logarithm of the gain; NaN where nothing follows its command. Shape (E,)."""
    with np.errstate(divide="ignore", invalid="ignore"):
        return np.where((asked > 0) & (seen > 0), np.log(seen) - np.log(asked), np.nan)


def _epochs(
    data: AuditInput, gains: Array, name: str, settings: AuditSettings, factors: Array | None
) -> list[Finding]:
    """Epochs whose gain is no arm's, or another than that of the other epochs."""
    groups = data.episodes.calibration_epoch
    absolute = group_medians(gains, groups, reference=0.0, least=LEAST_EPISODES)
    relative = group_medians(gains, groups, reference=None, least=LEAST_EPISODES)
    ratio = settings.gain_epoch_floor if factors is not None else settings.gain_floor
    findings = []
    for (epoch, count, gain, error), (_, _, gap, _) in zip(absolute, relative, strict=True):
        noise = settings.significance * error
        beyond = abs(gain) > max(np.log(settings.gain_floor), noise)
        beside = abs(gap) > max(np.log(ratio), noise)
        if factors is not None:
            factors[groups == epoch] = np.exp(gain)
        if count < LEAST_EPISODES or not (beyond or beside):
            continue
        where = f"epoch {epoch or '-'}"
        if beyond or factors is None:
            shown = gain if beyond else gap
            findings.append(_gain(name, where, shown, "gain_factor", settings.gain_floor))
        else:
            findings.append(_gain(name, where, gap, "gain_epoch_factor", ratio))
    return findings


def _episodes(
    data: AuditInput, gains: Array, name: str, settings: AuditSettings, factors: Array
) -> list[Finding]:
    """Some episodes whose gain is another than that of all, by one factor."""
    left = gains - np.log(factors)
    known = np.isfinite(left)
    if np.count_nonzero(known) < LEAST_EPISODES:
        return []
    centre, spread = densest_half(left[known])
    gap = np.where(known, left - centre, 0.0)
    off = np.abs(gap) > max(np.log(settings.gain_floor), settings.significance * 2.0 * spread)
    lone = off & (np.abs(gap) > np.log(LONE_FACTOR))
    total = int(np.count_nonzero(known))
    if name != "position":
        # A joint that is hindered follows by less, each time by another factor.
        lone &= False
        for side in (off & (gap > 0), off & (gap < 0)):
            few = np.count_nonzero(side) < LEAST_SCATTER
            if few or densest_half(gap[side])[1] > max(ONE_FACTOR, SCATTER * spread):
                off &= ~side
    if not (lone.any() or some(off, total, settings.outlier_share)):
        return []
    factors[off] *= np.exp(gap[off])
    names = data.episodes.uuid[off]
    # Episodes may be off both ways: the size is the usual one, the side that of most.
    size = float(np.copysign(np.median(np.abs(gap[off])), np.median(gap[off])))
    return [_gain(name, listed(names), size, "gain_factor", settings.gain_floor)]


def _off(values: Array, settings: AuditSettings) -> Array:
    """Logarithm of each episode's size against the usual one; 0 where it may be no unit."""
    size = np.abs(values)
    known = np.isfinite(size) & (size > 0)
    result = np.zeros(len(size))
    if np.count_nonzero(known) < max(LEAST_EPISODES, 0.9 * len(size)):
        return result
    # In logarithms smaller by a unit is as far as larger.
    logs = np.log(np.where(known, size, 1.0))
    centre, spread = densest_half(logs[known])
    gap = np.where(known, logs - centre, 0.0)
    least = max(np.log(settings.magnitude_floor), MAGNITUDE_SPREADS * spread)
    far = np.abs(gap) > least
    scattered = densest_half(size[known & ~far])[1]
    for side in (far & (gap > 0), far & (gap < 0)):
        if np.count_nonzero(side) >= LEAST_SCATTER:
            typical = float(np.median(gap[side]))
            # Two units leave nothing between them; a range that reaches down to zero does.
            between = known & (np.sign(gap) == np.sign(typical))
            between &= np.abs(np.abs(gap / typical) - 0.5) <= VALLEY / 2.0
            if np.count_nonzero(between) > BETWEEN * np.count_nonzero(side):
                continue
            expected = float(np.exp(typical)) * scattered
            scatter = densest_half(size[side])[1]
            # What does not scatter is a constant, and another constant is no unit.
            within = max(SCATTER, float(np.exp(abs(typical) / 2.0)))
            if not (expected > 0 and expected / within <= scatter <= expected * within):
                continue
            # Nor does a unit change signs: what passes through zero is small there.
            if abs(np.mean(values[side] > 0) - np.mean(values[known & ~far] > 0)) > SIGNS:
                continue
            result[side] = gap[side]
        else:
            lone = side & (np.abs(gap) > np.log(LONE_MAGNITUDE))
            result[lone] = gap[lone]
    return result


def _magnitude(data: AuditInput, name: str, off: Array, settings: AuditSettings) -> list[Finding]:
    chosen: Flags = off != 0.0
    if not chosen.any():
        return []
    factor = float(np.exp(np.median(np.abs(off[chosen]))))
    names = data.episodes.uuid[chosen]
    return [
        Finding(
            kind="unit",
            variable=name,
            where=listed(names),
            question="magnitude_factor",
            measured=factor,
            floor=settings.magnitude_floor,
            unit="factor",
            action=f"{name} is {'larger' if np.median(off[chosen]) > 0 else 'smaller'} by a "
            f"factor of {factor:.4g}{_named(factor)} in {len(names)} episodes ({listed(names)}): "
            "convert them to the unit of the contract, ingest again and repeat the audit.",
        )
    ]


def _gain(name: str, where: str, gain: float, question: str, floor: float) -> Finding:
    factor = float(np.exp(abs(gain)))
    side = "larger" if gain > 0 else "smaller"
    return Finding(
        kind="unit",
        variable=name,
        where=where,
        question=question,
        measured=factor,
        floor=floor,
        unit="factor",
        action=f"In {where} the observed motion of {name} is {side} by a factor of {factor:.4g}"
        f"{_named(factor)}: convert both to one unit, ingest again and repeat the audit.",
    )


def _named(factor: float) -> str:
    for value, words in FACTORS:
        if abs(np.log(factor / value)) < np.log(1.15):
            return f" (as between {words})"
    return ""
