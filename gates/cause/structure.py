"""Are there enough comparable demonstrations to answer, and are there modes that persist?"""

from dataclasses import replace

from gates.cause.answers import Answer, CauseName, Diagnosis, Named, Topic
from gates.cause.components import components, looked_in, trembling, unreadable
from gates.cause.hidden import OBSERVED, hidden, told_by_episode
from gates.cause.limits import CauseLimits
from gates.cause.numbers import Numbers, turned
from gates.words import percent, share_of
from genpolicy.audit.reach_rows import LEARNED, LOCAL, Reach
from genpolicy.statistics.intervals import clopper_pearson

WORDS = {
    LOCAL: "enough comparable demonstrations",
    LEARNED: "enough demonstrations alike in what predicts the action",
}
BY = {LOCAL: "by near neighbours", LEARNED: "by what predicts the action"}
OF_BOTH = ("two_mode_episodes", "denial_share")
ORDINALS = ("first", "second", "third", "fourth", "last")


def support(numbers: Numbers, limits: CauseLimits) -> Named:
    """Enough held-out episodes and situations with comparable demonstrations, of either kind."""
    answers = _enough(numbers, limits)
    red = next((answer for answer in answers if answer.red), None)
    if red is None:
        return answers, None
    other = _enough(turned(numbers), limits) if numbers.other is not None else []
    if other and not any(answer.red for answer in other):
        # Shown without a limit: the other evidence speaks in their place.
        return [*(replace(answer, limit=None) for answer in answers), *other], None
    counts = numbers.counts
    if red.question == "supported_share":
        found = f"{counts.share:.0%} of the held-out situations have"
        needed = f"{limits[red.question]:.0%}"
    else:
        what = "episodes" if red.question == "supported_episodes" else "situations"
        found, needed = f"{red.measured:g} held-out {what} have", f"{limits[red.question]:g}"
    return [*answers, *other], thin(
        f"Only {found} enough comparable training episodes ({needed} needed), and by what predicts "
        "the action too few can be compared as well: record more, from fewer starts."
    )


def _enough(numbers: Numbers, limits: CauseLimits) -> list[Answer]:
    counts, what = numbers.counts, WORDS[numbers.kind]

    def least(
        question: str, which: str, measured: float, note: str = "", counted: str = ""
    ) -> Answer:
        return Answer(
            question, Topic.SUPPORT, f"{which} {what}", measured, limits[question], ">=",
            note=note, counted=counted,
        )  # fmt: skip

    share = share_of(counts.analysed, counts.queries)
    return [
        least("supported_episodes", "held-out episodes with", counts.analysed_episodes),
        least(
            "held_out_situations", "held-out situations with", counts.analysed,
            counted=f"{counts.analysed_episodes} episodes",
        ),
        least("supported_share", "share of held-out situations with", counts.share, share),
    ]  # fmt: skip


def structure(numbers: Numbers, limits: CauseLimits) -> Named:
    """Several modes that persist, or support along the whole way to say that there are none.

    Two kinds of evidence look for them. Where one cannot speak the other does; where both do they
    must agree.
    """
    thin_here = any(answer.red for answer in _enough(numbers, limits))
    first = turned(numbers) if thin_here and numbers.other is not None else numbers
    answers, said = _seen(first, limits)
    if first.other is None:
        return answers, said
    second = turned(first)
    spoke = not any(answer.red for answer in _enough(second, limits))
    found, opinion = _seen(second, limits)
    found = [replace(answer, what=f"{answer.what}, {BY[second.kind]}") for answer in found]
    shown = [replace(answer, limit=None) for answer in found if answer.question in OF_BOTH]
    against = _disagree((first, said), (second, opinion), limits, spoke=spoke)
    if against is not None:
        return [*answers, *shown], against
    # What is too thin to deny here may be denied by the other.
    open_ = said is not None and (said.name, said.kind) == (
        CauseName.INSUFFICIENT_SUPPORT, "neighbourhoods",
    )  # fmt: skip
    if open_ and spoke and opinion is not None and opinion.name is CauseName.UNIMODAL:
        rest = [replace(answer, limit=None) for answer in answers]
        return [*rest, *found], opinion
    return [*answers, *shown], said


def _disagree(
    one: tuple[Numbers, Diagnosis | None],
    other: tuple[Numbers, Diagnosis | None],
    limits: CauseLimits,
    *,
    spoke: bool,
) -> Diagnosis | None:
    """Where the two contradict each other, with the numbers of both; None where they do not."""
    (first, said), (second, opinion) = one, other
    here, there = WORDS[first.kind], WORDS[second.kind]
    learned = second.other if second.kind == LOCAL else first.other
    asked = (learned.confirmed, learned.contradicted) if learned else (0, 0)
    modes = first.counts.two_mode_episodes
    few = limits["confirmed_share"] * sum(asked) - asked[0] > 0
    if said is None and few and asked[1] - limits["contradicted_situations"] >= 0:
        # What the policy sees and takes for near is told by what predicts: no contradiction.
        told = hidden(first, limits)[1]
        if told is not None and told.kind == OBSERVED:
            return None
        text = (
            f"{modes} held-out episodes show modes by {here}; of their situations {asked[0]} show "
            f"them by {there} as well, and {asked[1]} do not, though they would be seen"
        )
    elif (
        said is not None
        and said.name is CauseName.UNIMODAL
        and spoke
        # Whether modes persist is asked only where enough were found.
        and (opinion is None or opinion.kind == "persistence")
    ):
        text = (
            f"No modes were found by {here}, and in {second.counts.two_mode_episodes} of "
            f"{second.counts.primary_episodes} held-out episodes by {there}"
        )
    else:
        return None
    return thin(
        f"{text}: the two kinds of evidence disagree. Record more, from fewer starts.",
        kind="evidence_disagrees",
    )


def _seen(numbers: Numbers, limits: CauseLimits) -> Named:
    """What one kind of evidence says."""
    counts, kept = numbers.counts, numbers.kept
    needed = max(limits["two_mode_episodes"], limits["two_mode_share"] * counts.primary_episodes)
    modes = Answer(
        "two_mode_episodes", Topic.STRUCTURE, "held-out episodes with several modes",
        counts.two_mode_episodes, needed, ">=",
        note=f"{counts.two_mode} situations; {counts.resolved} more have clusters that the "
        "observation tells apart",
    )  # fmt: skip
    long_enough = Answer(
        "multimodal_situations", Topic.STRUCTURE,
        "situations that go on long enough to see them persist", kept.n,
        limits["multimodal_situations"], ">=", counted=f"{counts.two_mode_episodes} episodes",
    )  # fmt: skip
    margin = Answer(
        "persistence_margin", Topic.STRUCTURE,
        "episodes that keep their mode a chunk later, beyond what chance reaches in 95 of 100",
        kept.observed - kept.null_q95 if kept.n else None, limits["persistence_margin"], ">=",
        note=f"{percent(kept.observed)} against {percent(kept.null_q95)}" if kept.n
        else "not measured",
        counted=f"{kept.n} situations",
    )  # fmt: skip
    persistent = Answer(
        "multimodal_situations", Topic.STRUCTURE, "situations whose modes persist",
        counts.persistent, limits["multimodal_situations"], ">=",
        counted=f"{counts.two_mode_episodes} episodes",
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
        if not margin.red and told_by_episode(numbers, limits):
            few = (long_enough, persistent)
            return [replace(a, limit=None) if a in few else a for a in answers], None
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
    denied, falling = _denied(numbers, limits), _falling_apart(numbers, limits, apart)
    few = _few(numbers, limits)
    column, shaking = trembling(numbers, limits)
    answers = [*denied, falling, few, *shaking]
    beside = max(apart, _apart_of_other(numbers))
    if any(answer.red for answer in denied):
        return answers, thin(_where(numbers, limits, blank))
    if white or falling.red or column:
        what = "The spread is noise from action to action"
        if not white:
            what = f"The clusters of {apart:.0%} of the situations do not persist"
            what = what if falling.red else f"{column} trembles from action to action"
        return answers, _noise(what, "" if white or falling.red else column)
    if few.red:
        text = (
            f"Clusters were found in {counts.two_mode_episodes} of {counts.primary_episodes} "
            f"held-out episodes: more than chance gives ({limits['two_mode_chance']:.0%}), fewer "
            f"than show modes ({limits['two_mode_share']:.0%}): record more, from fewer starts."
        )
        return answers, thin(text, kind="few_clusters")
    # What falls apart more often than chance clusters is not denied, whoever saw it.
    if beside - limits["two_mode_chance"] > 0:
        text = (
            f"The clusters of {beside:.0%} of the situations do not persist: more than chance "
            f"gives ({limits['two_mode_chance']:.0%}), fewer than noise makes "
            f"({limits['incoherent_share']:.0%}): record more, from fewer starts."
        )
        return answers, thin(text, kind="few_clusters")
    if unread:
        text = (
            f"No modes were found, but those of {', '.join(unread)} could not be looked for: "
            "record the commands so that they can be read, and repeat the audit."
        )
        return answers, Diagnosis(CauseName.INSUFFICIENT_SUPPORT, unread[0], "component", text)
    # A handful of situations with clusters is luck, and decides nothing.
    many = counts.resolved - limits["two_mode_chance"] * max(counts.analysed, 1) >= 0
    decided = many and counts.resolved > counts.two_mode
    text = (
        "Use the simple baselines: no two separate actions were found under one observation, in "
        f"{looked_in(numbers)}."
    )
    kind = "observation_decides" if decided else ""
    return answers, Diagnosis(CauseName.UNIMODAL, "", kind, text)


def _apart_of_other(numbers: Numbers) -> float:
    """The share of situations whose clusters fall apart, of the other kind of evidence."""
    if numbers.other is None or not numbers.other.analysed:
        return 0.0
    return numbers.other.incoherent / numbers.other.analysed


def _denied(numbers: Numbers, limits: CauseLimits) -> list[Answer]:
    """Support to deny modes: in all, and in the fifth of the way that has least."""
    counts, limit = numbers.counts, limits["denial_share"]
    answers = [
        Answer(
            "denial_share", Topic.STRUCTURE,
            "share of situations with enough demonstrations to deny modes", counts.share,
            limit, ">=", note="modes may hide in the others",
        )
    ]  # fmt: skip
    if numbers.reach:
        least = min(numbers.reach, key=lambda row: (row.share, row.fifth))
        listed = ", ".join(percent(row.share) for row in numbers.reach)
        answers.append(
            Answer(
                "denial_share", Topic.STRUCTURE,
                f"the same share in the {ORDINALS[least.fifth - 1]} fifth of the way, the least",
                least.share, limit, ">=", note=f"from the first to the last fifth: {listed}",
            )
        )  # fmt: skip
    return answers


def _few(numbers: Numbers, limits: CauseLimits) -> Answer:
    """Too few episodes with clusters to show modes; may they be more than chance gives?"""
    counts = numbers.counts
    # One side is asked, so that side alone has the confidence.
    coverage = 2.0 * limits.confidence - 1.0
    lower = clopper_pearson(counts.two_mode_episodes, counts.primary_episodes, coverage)[0]
    return Answer(
        "two_mode_chance", Topic.STRUCTURE,
        "share of held-out episodes with several modes, lower bound", lower,
        limits["two_mode_chance"], "<=",
        note=share_of(counts.two_mode_episodes, counts.primary_episodes),
    )  # fmt: skip


def _falling_apart(numbers: Numbers, limits: CauseLimits, apart: float) -> Answer:
    counts = numbers.counts
    return Answer(
        "incoherent_share", Topic.STRUCTURE, "share of situations whose clusters fall apart",
        apart, limits["incoherent_share"], "<=", note=share_of(counts.incoherent, counts.analysed),
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


def _noise(what: str, column: str = "") -> Diagnosis:
    text = f"{what}: use chunked behaviour cloning, which averages it out."
    return Diagnosis(CauseName.POINTWISE_NOISE, column, "", text)
