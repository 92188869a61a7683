"""Findings about a candidate's numbers: do they speak of the moment, in the declared units?"""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from genpolicy.candidates.conformance.asked import Asked
from genpolicy.candidates.conformance.finding import ONE_IN_TWO, PLAUSIBLE, Finding, Judged
from genpolicy.candidates.conformance.placed import Offset, offsets, turned_away
from genpolicy.candidates.conformance.plausible import (
    FEWEST,
    STANDS_M,
    Slope,
    copied,
    nearest,
    shuffled_share,
    slopes,
    start_slopes,
    turn_slopes,
)
from genpolicy.candidates.conformance.recorded_starts import RecordedStarts
from genpolicy.seeds import stream
from genpolicy.statistics.intervals import clopper_pearson

Array = NDArray[np.float64]

SAME_SCALE = 3.0
"""A slope beyond a factor of three either way is another unit, sign or spread: a weak policy's
slope is still nearer to 1, a wrong unit's is 10 times off."""
KNOWS_THE_MOMENT = 0.001


def plausible(asked: Asked, starts: RecordedStarts) -> list[Finding]:
    """Whether its chunks speak of the moment, in the units that were declared.

    Of each episode its first moment is asked for everything, since those of one episode are not
    independent; only `along` asks for all of them.
    """
    finite = [row for row, one in sorted(asked.answers.items()) if np.isfinite(one.actions).all()]
    rows = [row for row in finite if row < starts.apart]
    if len(rows) < FEWEST:
        said = f"{len(rows)} finite answers, {FEWEST} are needed"
        return [Finding(name, "unknown", "B", said) for name in PLAUSIBLE]
    drawn = np.stack([asked.answers[row].actions for row in rows])
    recorded, measured = starts.chunks[rows], starts.measured[rows]
    chunks = nearest(drawn, recorded)
    share = shuffled_share(drawn, recorded, rng=stream(0, "conformance", "shuffle"))
    follows = share <= KNOWS_THE_MOMENT
    copies = copied(drawn, recorded)
    begun = beginnings(drawn, recorded, measured, starts.episodes[rows])
    scaled = scale(
        chunks, recorded, follows=follows, begun=begun, along=along(asked, starts, finite)
    )
    return [
        Finding(
            PLAUSIBLE[0], "holds" if follows else "fails", "B",
            f"as near to other moments' recordings in {share:.4f} of the shuffles, at most "
            f"{KNOWS_THE_MOMENT}",
        ),
        scaled,
        origin(offsets(drawn, recorded, measured), follows and scaled.judged != "fails"),
        orientation(chunks, recorded, measured),
        Finding(
            PLAUSIBLE[4], "fails" if copies else "holds", "B",
            f"{copies} of {len(rows)} moments answered with the recording itself",
        ),
    ]  # fmt: skip


def along(asked: Asked, starts: RecordedStarts, finite: Sequence[int]) -> list[Slope]:
    """`beginnings` at all moments of each episode of which every one was answered, if it has more.

    Where a way forks, recordings go to either side, and so does a mirrored policy. Behind the fork
    the hand stands on one side, and chunks of a mirrored policy begin on the other. How long
    that lasts is a part of an episode: one moment of each rarely lies there.
    """
    if len(starts) == starts.apart:
        return []
    missing = set(range(len(starts))) - set(finite)
    partly = {starts.episodes[row] for row in missing}
    rows = [row for row in finite if starts.episodes[row] not in partly]
    if len(np.unique(starts.episodes[rows])) < FEWEST:
        return []
    drawn = np.stack([asked.answers[row].actions for row in rows])
    found = beginnings(drawn, starts.chunks[rows], starts.measured[rows], starts.episodes[rows])
    return [replace(one, name=f"{one.name} of all moments") for one in found]


def beginnings(
    drawn: Array, recorded: Array, measured: Array, episodes: NDArray[np.str_]
) -> list[Slope]:
    """How places that chunks begin at follow the robot, on axes on which recordings follow it."""
    ours, theirs = (
        start_slopes(of, measured, episodes, rng=stream(0, "conformance", "starts"))
        for of in (recorded[:, None], drawn)
    )
    follow = {one.name for one in ours if _right(one)}
    return [one for one in theirs if one.name in follow]


def scale(
    chunks: Array,
    recorded: Array,
    *,
    follows: bool,
    begun: Sequence[Slope] = (),
    along: Sequence[Slope] = (),
) -> Finding:
    """Whether places and the opening move as recorded ones do. Chunks: (M, K, 10).

    Args:
        chunks: The nearest of each moment.
        recorded: What was done there.
        follows: Whether chunks speak of the moment.
        begun: See `beginnings`.
        along: See `along`. Of these the sign alone is asked for: a weak policy that shrinks places
            towards their mean is no other unit, and would look like one in so many moments.
    """
    moved = slopes(chunks, recorded, rng=stream(0, "conformance", "slopes"))
    found = [*moved, *begun]
    if not found:
        return Finding("scale", "unknown", "B", "nothing moves in the recordings")
    said = f"recorded per declared unit, 1 is right: {_listed([*found, *along])}"
    wrong = [one.name for one in found if _wrong(one)]
    wrong += [one.name for one in along if one.high < 0.0]
    if wrong:
        return Finding("scale", "fails", "B", f"{said}; wrong: {', '.join(wrong)}")
    # Of many chunks that know nothing the nearest lie on the line too.
    # Where chunks begin accuses only: a rough policy hardly knows where it stands.
    right = follows and bool(moved) and all(_right(one) for one in moved)
    return Finding("scale", "holds" if right else "unknown", "B", said)


def _wrong(one: Slope) -> bool:
    """Beyond what noise on both sides explains."""
    return one.stands or one.high < 1.0 / SAME_SCALE or one.low > SAME_SCALE


def _right(one: Slope) -> bool:
    return one.low >= 1.0 / SAME_SCALE and one.high <= SAME_SCALE


def _listed(found: Sequence[Slope]) -> str:
    return ", ".join(
        f"{one.name} {one.slope:.3g} ({one.low:.3g} to {one.high:.3g})" for one in found
    )


def origin(found: list[Offset], comparable: bool) -> Finding:
    """Whether chunks begin where the robot is.

    Args:
        found: Offsets of first actions.
        comparable: Its numbers speak of the moment and in its units; else none of them is a place.
    """
    if not comparable:
        said = "its numbers do not speak of the moment in the declared units"
        return Finding("origin", "unknown", "B", said)
    if not any(np.isfinite(one.step) for one in found):
        return Finding("origin", "unknown", "B", "the observation does not say where the TCP is")
    far = [one for one in found if one.low > one.step or one.high < -one.step]
    off = [one for one in found if one.apart_low > STANDS_M or one.apart_high < -STANDS_M]
    if far:
        text = ", ".join(
            f"{one.name} {1e3 * one.low:.3g} to {1e3 * one.high:.3g} mm (a step is "
            f"{1e3 * one.step:.3g} mm)" for one in far
        )  # fmt: skip
        return Finding("origin", "fails", "B", f"chunks begin off the measured place: {text}")
    if off:
        text = ", ".join(
            f"{one.name} {1e3 * one.apart_low:.3g} to {1e3 * one.apart_high:.3g} mm" for one in off
        )
        said = f"beside the recorded first actions by too little to tell offset from bias: {text}"
        return Finding("origin", "unknown", "B", said)
    across = [one.name for one in found if one.low < -one.step or one.high > one.step]
    if across:
        said = f"begin too far apart from each other to say: {', '.join(across)}"
        return Finding("origin", "unknown", "B", said)
    reach = 1e3 * max(max(abs(one.apart_low), abs(one.apart_high)) for one in found)
    said = f"chunks begin where the recorded ones do, to within {reach:.3g} mm"
    return Finding("origin", "holds", "B", said)


def orientation(chunks: Array, recorded: Array, measured: Array) -> Finding:
    """Whether chunks begin turned as the hand is, and turn the way recordings turn."""
    away, compared, step = turned_away(chunks, recorded, measured)
    low, high = clopper_pearson(away, compared)
    turns = turn_slopes(chunks, recorded, rng=stream(0, "conformance", "turns"))
    said = f"at {away} of {compared} turned from the hand by more than {step:.3g} rad"
    said += f"; recorded per turn: {_listed(turns)}" if turns else ""
    judged: Judged = "unknown"
    if low > ONE_IN_TWO or any(one.high < 0.0 for one in turns):
        judged = "fails"
    elif high < ONE_IN_TWO and all(_right(one) for one in turns):
        judged = "holds"
    return Finding("orientation", judged, "B", said)
