"""What a plan can decide, for a person."""

import textwrap

from gates.planned_blocks import Saved
from gates.planned_power import MOST_STARTS, Gain, Stated
from gates.planning import Plan
from genpolicy.contract.planner import PLANNER

COLUMNS = 80
WHATEVER = "Gate D would be INCONCLUSIVE whatever the rollouts show"


def plan_text(plan: Plan) -> str:
    """The plan for a person, 80 columns."""
    lines = [
        f"{plan.starts} starts of {plan.methods} methods in {len(plan.conditions)} conditions: "
        f"{plan.rollouts:,} rollouts,",
        *_beside(plan),
        f"at most {plan.longest_s / 3600:.1f} h of virtual time",
        f"{len(plan.candidates)} registered candidates, each at alpha {plan.alpha:.3g}; "
        f"margin {plan.margin:g}",
        "",
        *_stated_text(plan),
        *_simple_text(plan),
        *_weighed_text(plan),
        "",
        "What these starts can show",
    ]
    wide = max((len(bound.criterion) for bound in plan.bounds), default=0)
    marks = {True: " ", False: "!", None: "?"}
    for bound in plan.bounds:
        begin = f"{marks[bound.decidable]} {bound.criterion:<{wide}}  "
        indent = " " * len(begin)
        lines += textwrap.wrap(bound.says, COLUMNS, initial_indent=begin, subsequent_indent=indent)
    lines += [
        "",
        f"Smallest gain that is found in {plan.power:.0%} of trials with {plan.starts} starts",
        *(_gain_text(gain) for gain in plan.gains),
    ]
    lines += _saved_text(plan)
    open_ = [name for name in plan.undecidable if name not in plan.failing]
    if plan.failing:
        lines += _warned(
            f"Gate D would be a FAIL whatever the rollouts show: {', '.join(plan.failing)}. The "
            "test promotes without a gain, which more starts do not mend."
        )
    if open_:
        what = "Not to be shown either" if plan.failing else WHATEVER
        lines += _warned(
            f"{what}: {', '.join(open_)}. Plan more starts (stress.starts) before any is run."
        )
    return "\n".join(lines)


def _warned(text: str) -> list[str]:
    return ["", *textwrap.wrap(text, COLUMNS)]


def _beside(plan: Plan) -> list[str]:
    """What is run and not compared, where there is some."""
    graded, probed, searched = plan.graded_rollouts, plan.probe_rollouts, plan.searched_rollouts
    further = f"by further training seeds, {plan.further_seeds} of them (policy.seeds),"
    return [
        *([f"{graded:,} beside them of graded sizes (stress.severities),"] if graded else []),
        *([f"{plan.further_rollouts:,} beside them {further}"] if plan.further_seeds else []),
        *([f"up to {probed:,} after them for the monitors (monitors),"] if probed else []),
        *(
            [f"up to {searched:,} behind the gate for failures (card.failure_search),"]
            if searched
            else []
        ),
    ]


def _stated_text(plan: Plan) -> list[str]:
    stated = plan.stated
    needed = (
        f"from about {stated.starts_needed} starts on"
        if stated.starts_needed is not None
        else f"not even by {MOST_STARTS} starts"
    )
    return [
        f"The stated effect: {plan.measure} {stated.candidate_success:.0%} against "
        f"{stated.baseline_success:.0%} (stress.planned_effect)",
        f"  found in {stated.promote_share:.0%} of trials with {plan.starts} starts; in "
        f"{plan.power:.0%} {needed}",
        *_crowded_text(stated),
    ]


def _simple_text(plan: Plan) -> list[str]:
    """Each method that a candidate must beat, by name."""
    lacks = "" if PLANNER in plan.simple else f"; no {PLANNER}: none is compared"
    return _warned(f"To beat, each by the margin: {', '.join(plan.simple)}{lacks}")


def _crowded_text(stated: Stated) -> list[str]:
    """What the power is where the best baseline is not alone."""
    if stated.baselines < 2:
        return []
    return [
        f"  in {stated.crowded_share:.0%} if all {stated.baselines} simple methods are worth "
        f"{stated.baseline_success:.0%}"
    ]


def _weighed_text(plan: Plan) -> list[str]:
    """What is compared where it is not success, and what that does to the power."""
    if not plan.weighed:
        return []
    return _warned(
        f"Compared is utility: a success less {plan.weighed}, each as a share of the longest "
        "rollout; all else is 0. Margin, effect and gains are of utility, and outcomes are taken "
        "as 0 or 1, the hardest of their means. Is the effect one of success, and costs every "
        f"success all that it can, it is found in {plan.stated.dearest_share:.0%}."
    )


def _saved_text(plan: Plan) -> list[str]:
    """How far candidates run where who can no longer pass is stopped."""
    if plan.block is None:
        return []
    return [
        "",
        f"Stopped where it can no longer pass, asked every {plan.block} starts (stress.block):",
        *(_ran_text(saved) for saved in plan.saved),
        "  and whoever stays in, with the simple methods beside it, runs them all",
    ]


def _ran_text(saved: Saved) -> str:
    return (
        f"  {saved.what}, {saved.candidate_success:.0%}: runs {saved.ran_share:.0%} of the starts "
        f"on average, stopped in {saved.stopped_share:.0%}"
    )


def _gain_text(gain: Gain) -> str:
    if gain.candidate_success is None:
        most = f"a candidate that never fails in {gain.promote_share:.0%} only"
        return f"  baseline {gain.baseline_success:.0%}: none; {most}"
    points = round((gain.candidate_success - gain.baseline_success) * 100)
    return (
        f"  baseline {gain.baseline_success:.0%}: {points} points, a candidate of "
        f"{gain.candidate_success:.0%}"
    )
