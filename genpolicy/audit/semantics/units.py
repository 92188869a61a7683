"""Units: is the observed motion as large as the commanded one, and a value as large as its like?

Standard deviations inside an episode are compared, so that neither lag nor frame matters. A factor
that no arm produces is a unit; so is an epoch that answers by another factor than the others.
"""

import numpy as np

from genpolicy.audit.data import Array, AuditInput, Flags
from genpolicy.audit.rows import Finding
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
# Motion below this share of the usual one has no gain.
MOVING_SHARE = 0.1
# A factor between episodes may be one of units if it is also this many spreads...
MAGNITUDE_SPREADS = 8.0
# ...and if the scatter of the episodes is larger by that factor too, within another one: an object
# that stands elsewhere scatters as before.
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
    data: AuditInput, motion: Motion, settings: AuditSettings
) -> tuple[list[Finding], Array]:
    """Factors between commanded and observed motion.

    Returns:
        Findings, and the usual factor of each episode, which is taken out before clocks are
        measured. Shape (E,).
    """
    factors = np.ones(len(data.episodes))
    if motion.commanded.shape[1] == 0:
        return [], factors
    asked = episode_deviation(motion.commanded, motion.starts)
    seen = episode_deviation(motion.observed, motion.starts)
    gains = _log_gain(np.linalg.norm(seen, axis=1), np.linalg.norm(asked, axis=1))
    findings = _epochs(data, gains, "position", settings, factors)
    findings += _episodes(data, gains, settings, factors)
    return findings, factors


def component_findings(data: AuditInput, motion: Motion, settings: AuditSettings) -> list[Finding]:
    """The same for single components, once no frame is turned and no column swapped."""
    asked = episode_deviation(motion.commanded, motion.starts)
    seen = episode_deviation(motion.observed, motion.starts)
    findings = []
    for column, name in enumerate(motion.names):
        gains = _log_gain(seen[:, column], asked[:, column])
        findings += _epochs(data, gains, name, settings, None)
    return findings


def magnitude_findings(data: AuditInput, motion: Motion, settings: AuditSettings) -> list[Finding]:
    """Episodes whose positions or channels are larger or smaller than all others by a unit."""
    findings = []
    if motion.commanded.shape[1]:
        size = np.linalg.norm(episode_medians(np.abs(motion.commanded), motion.starts), axis=1)
        travel = np.linalg.norm(episode_deviation(motion.commanded, motion.starts), axis=1)
        both = np.stack([_off(size, settings), _off(travel, settings)])
        # Both must say the same factor: a start elsewhere or an arm that stands is no unit.
        same = np.abs(both[0] - both[1]) <= np.log(2.0)
        findings += _magnitude(data, "position", np.where(same, both[0], 0.0), settings)
    for name, part in data.context.items():
        # Component by component: beside a direction cosine a length hardly counts.
        medians = episode_medians(data.observation[:, part], motion.starts)
        off = np.stack([_off(np.abs(values), settings) * _clear(values) for values in medians.T])
        worst = off[np.argmax(np.abs(off), axis=0), np.arange(off.shape[1])]
        findings += _magnitude(data, name, worst, settings)
    return findings


def _clear(values: Array) -> Array:
    """0 for small values of a component that lies about zero: there, small is no other unit."""
    about_zero = min(np.mean(values > 0), np.mean(values < 0)) > 0.05
    small = np.abs(values) <= np.quantile(np.abs(values), 0.5)
    return np.where(about_zero & small, 0.0, 1.0)


def _log_gain(seen: Array, asked: Array) -> Array:
    """Logarithm of the gain; NaN where next to nothing is commanded. Shape (E,)."""
    typical = np.median(asked)
    valid = (asked > MOVING_SHARE * typical) & (seen > 0)
    with np.errstate(divide="ignore", invalid="ignore"):
        return np.where(valid, np.log(seen) - np.log(asked), np.nan)


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
    data: AuditInput, gains: Array, settings: AuditSettings, factors: Array
) -> list[Finding]:
    """Single episodes whose gain is another than that of all."""
    left = gains - np.log(factors)
    known = np.isfinite(left)
    if np.count_nonzero(known) < LEAST_EPISODES:
        return []
    centre, spread = densest_half(left[known])
    gap = np.where(known, left - centre, 0.0)
    off = np.abs(gap) > max(np.log(settings.gain_floor), settings.significance * 2.0 * spread)
    lone = off & (np.abs(gap) > np.log(LONE_FACTOR))
    total = int(np.count_nonzero(known))
    if not (lone.any() or some(off, total, settings.outlier_share)):
        return []
    factors[off] *= np.exp(gap[off])
    names = data.episodes.uuid[off]
    # Episodes may be off both ways: the size is the usual one, the side that of most.
    size = float(np.copysign(np.median(np.abs(gap[off])), np.median(gap[off])))
    return [_gain("position", listed(names), size, "gain_factor", settings.gain_floor)]


def _off(size: Array, settings: AuditSettings) -> Array:
    """Logarithm of each episode's size against the usual one; 0 where it may be no unit."""
    known = np.isfinite(size)
    result = np.zeros(len(size))
    if np.count_nonzero(known) < max(LEAST_EPISODES, 0.9 * len(size)):
        return result
    centre, spread = densest_half(size[known])
    if not 0.5 * centre - spread > 0:  # nothing is usual
        return result
    gap = np.log(np.maximum(np.where(known, size, centre), 1e-12 * centre) / centre)
    beyond = np.abs(size - centre) > MAGNITUDE_SPREADS * spread
    far = known & beyond & (np.abs(gap) > np.log(settings.magnitude_floor))
    scattered = densest_half(size[known & ~far])[1]
    for side in (far & (gap > 0), far & (gap < 0)):
        if np.count_nonzero(side) >= LEAST_SCATTER:
            factor = float(np.exp(np.median(gap[side])))
            scatter = densest_half(size[side])[1]
            expected = factor * scattered
            if expected > 0 and not expected / SCATTER <= scatter <= expected * SCATTER:
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
