"""Are there enough comparable demonstrations to answer, and are there modes that persist?"""

from gates.cause.answers import Answer, CauseName, Diagnosis, Layer, Named
from gates.cause.components import components, looked_in, unreadable
from gates.cause.limits import CauseLimits
from gates.cause.numbers import Numbers
from genpolicy.audit.reach_rows import Reach

ORDINALS = ("first", "second", "third", "fourth", "last")


def support(numbers: Numbers, limits: CauseLimits) -> Named:
    """Enough held-out episodes and situations with comparable demonstrations."""
    counts = numbers.counts

    def least(question: str, what: str, measured: float, note: str = "") -> Answer:
        return Answer(question, Layer.SUPPORT, what, measured, limits[question], ">=", note=note)

    answers = [
        least(
            "supported_episodes",
            "held-out episodes with enough comparable demonstrations",
            counts.analysed_episodes,
        ),
        least(
            "held_out_situations",
            "held-out situations with enough of them",
            counts.analysed,
        ),
        least(
            "supported_share",
            "share of held-out situations with enough of them",
            counts.share,
            f"{counts.analysed} of {counts.queries}",
        ),
    ]
    red = next((answer for answer in answers if answer.red), None)
    if red is None:
        return answers, None
    if red.question == "supported_share":
        found = f"{counts.share:.0%} of the held-out situations have"
        needed = f"{limits[red.question]:.0%}"
    else:
        what = "episodes" if red.question == "supported_episodes" else "situations"
        found, needed = f"{red.measured:g} held-out {what} have", f"{limits[red.question]:g}"
    return answers, thin(
        f"Only {found} enough comparable training episodes ({needed} needed): record more, from "
        "fewer starts."
    )


def structure(numbers: Numbers, limits: CauseLimits) -> Named:
    """Several modes that persist, or support along the whole way to say that there are none."""
    counts, kept = numbers.counts, numbers.kept
    needed = max(limits["two_mode_episodes"], limits["two_mode_share"] * counts.primary_episodes)
    modes = Answer(
        "two_mode_episodes", Layer.STRUCTURE, "held-out episodes with several modes",
        counts.two_mode_episodes, needed, ">=",
        note=f"{counts.two_mode} situations; {counts.resolved} more have clusters that the "
        "observation tells apart",
    )  # fmt: skip
    long_enough = Answer(
        "multimodal_situations", Layer.STRUCTURE,
        "situations that go on long enough to see them persist", kept.n,
        limits["multimodal_situations"], ">=",
    )  # fmt: skip
    margin = Answer(
        "persistence_margin", Layer.STRUCTURE,
        "episodes that keep their mode a chunk later, beyond what chance reaches in 95 of 100",
        kept.observed - kept.null_q95 if kept.n else None, limits["persistence_margin"], ">=",
        note=f"{kept.observed:.2f} against {kept.null_q95:.2f}" if kept.n else "not measured",
    )  # fmt: skip
    persistent = Answer(
        "multimodal_situations", Layer.STRUCTURE, "situations whose modes persist",
        counts.persistent, limits["multimodal_situations"], ">=",
    )  # fmt: skip
    answers = [modes, *components(numbers), long_enough, margin, persistent]
    white = all(_noisy(numbers, limits))
    if modes.red or (white and long_enough.red):
        absent, verdict = _absent(numbers, limits, white=white)
        return [*answers, *absent], verdict
    if long_enough.red or persistent.red:
        number = kept.n if long_enough.red else counts.persistent
        # Clusters that fall apart are noise, however many there are.
        if margin.red and not long_enough.red:
            return answers, _noise("Clusters do not persist over a chunk")
        return answers, thin(
            f"Only {number} situations with several modes "
            f"{'go on long enough to see whether the modes' if long_enough.red else 'are seen to'} "
            f"persist ({limits['multimodal_situations']:g} needed): record more, from fewer "
            "starts.",
            kind="persistence",
        )
    return answers, _noise("Clusters do not persist over a chunk") if margin.red else None


def _absent(
    numbers: Numbers, limits: CauseLimits, *, white: bool
) -> tuple[list[Answer], Diagnosis]:
    """No modes were found; is that enough to say that there are none?"""
    counts, unread = numbers.counts, unreadable(numbers)
    blank = [row for row in numbers.reach if limits["denial_share"] - row.share > 0]
    apart = counts.incoherent / counts.analysed if counts.analysed else 0.0
    answers = [*_denied(numbers, limits), _falling_apart(numbers, limits, apart)]
    if any(answer.red for answer in answers[:2]):
        return answers, thin(_where(numbers, limits, blank))
    if white:
        return answers, _noise("The spread is noise from action to action")
    if answers[-1].red:
        return answers, _noise(f"The clusters of {apart:.0%} of the situations do not persist")
    if unread:
        text = (
            f"No modes were found, but those of {', '.join(unread)} could not be looked for: "
            "record the commands so that they can be read, and repeat the audit."
        )
        return answers, Diagnosis(CauseName.INSUFFICIENT_SUPPORT, unread[0], "component", text)
    decided = counts.resolved > counts.two_mode
    text = (
        "Use the simple baselines: no two separate actions were found under one observation, in "
        f"{looked_in(numbers)}."
    )
    kind = "observation_decides" if decided else ""
    return answers, Diagnosis(CauseName.UNIMODAL, "", kind, text)


def _denied(numbers: Numbers, limits: CauseLimits) -> list[Answer]:
    """Support to deny modes: in all, and in the fifth of the way that has least."""
    counts, limit = numbers.counts, limits["denial_share"]
    answers = [
        Answer(
            "denial_share", Layer.STRUCTURE,
            "share of situations with enough demonstrations to deny modes", counts.share,
            limit, ">=", note="modes may hide in the others",
        )
    ]  # fmt: skip
    if numbers.reach:
        least = min(numbers.reach, key=lambda row: (row.share, row.fifth))
        listed = ", ".join(f"{row.share:.2f}" for row in numbers.reach)
        answers.append(
            Answer(
                "denial_share", Layer.STRUCTURE,
                f"the same share in the {ORDINALS[least.fifth - 1]} fifth of the way, the least",
                least.share, limit, ">=", note=f"from the first to the last fifth: {listed}",
            )
        )  # fmt: skip
    return answers


def _falling_apart(numbers: Numbers, limits: CauseLimits, apart: float) -> Answer:
    counts = numbers.counts
    return Answer(
        "incoherent_share", Layer.STRUCTURE, "share of situations whose clusters fall apart",
        apart, limits["incoherent_share"], "<=", note=f"{counts.incoherent} of {counts.analysed}",
    )  # fmt: skip


def _noisy(numbers: Numbers, limits: CauseLimits) -> tuple[bool, bool, bool]:
    """Whether the spread is white along a chunk, wide, and much of all that chunks differ by."""
    counts = numbers.counts
    return (
        counts.noise_ratio - limits["noise_ratio"] >= 0,
        counts.noise_spread - limits["noise_spread_m"] * numbers.metre >= 0,
        counts.white_share - limits["white_share"] >= 0,
    )


def _where(numbers: Numbers, limits: CauseLimits, blank: list[Reach]) -> str:
    """In words: where nothing could be looked at."""
    share, needed = numbers.counts.share, limits["denial_share"]
    text = (
        f"No modes were found in the {share:.0%} of the held-out situations that have enough "
        "comparable training episodes; the others may hold some"
    )
    if blank:
        fifths = ", ".join(f"{ORDINALS[row.fifth - 1]} ({row.share:.0%})" for row in blank)
        text += f", above all in these fifths of the way: {fifths}"
    return (
        f"{text} ({needed:.0%} needed to deny it, in every fifth): record more, from fewer starts."
    )


def thin(text: str, *, kind: str = "neighbourhoods") -> Diagnosis:
    """Too little to say."""
    return Diagnosis(CauseName.INSUFFICIENT_SUPPORT, "", kind, text)


def _noise(what: str) -> Diagnosis:
    text = f"{what}: use chunked behaviour cloning, which averages it out."
    return Diagnosis(CauseName.POINTWISE_NOISE, "", "", text)
