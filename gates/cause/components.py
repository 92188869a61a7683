"""In which components of the action modes were looked for, so that no verdict claims more."""

from gates.cause.answers import Answer, Topic
from gates.cause.limits import CauseLimits
from gates.cause.numbers import Numbers
from genpolicy.audit.component_rows import (
    NOT_LOOKED_AT,
    OTHER,
    POSITION,
    ComponentModes,
    Tremor,
)

# The causes of these topics speak of modes, or of their absence.
SPEAK_OF_MODES = (Topic.STRUCTURE, Topic.HIDDEN, Topic.VALIDITY, Topic.NONE)


def components(numbers: Numbers) -> list[Answer]:
    """One answer for each component, without a limit: the one followed is judged beside them."""
    return [_answer(item) for item in numbers.components]


def followed(numbers: Numbers) -> str:
    """The component whose modes the counts, variables and outcomes are about."""
    return next((item.component for item in numbers.components if item.followed), "")


def trembling(numbers: Numbers, limits: CauseLimits) -> tuple[str, list[Answer]]:
    """The number of the action that trembles most, if one does, and the answer about it."""
    # As much noise beside a route as beside what sets two of its modes apart.
    route = next((item for item in numbers.components if item.component == POSITION), None)
    if route is None or not numbers.tremors:
        return "", []
    least = limits["noise_spread_m"] * numbers.metre / route.separation

    def wide(item: Tremor) -> bool:
        return item.ratio - limits["noise_ratio"] >= 0 and item.spread - least >= 0

    worst = max(numbers.tremors, key=lambda item: (wide(item), item.white_share))
    trembles = wide(worst) and worst.white_share - limits["white_share"] >= 0
    answer = Answer(
        "white_share", Topic.STRUCTURE,
        f"share of white noise in the spread of {worst.column}, of all numbers the most",
        worst.white_share, limits["white_share"] if wide(worst) else None, "<=",
        note=f"noise ratio {worst.ratio:.2f}, {worst.spread:.2g} of what sets two modes apart",
    )  # fmt: skip
    return worst.column if trembles else "", [answer]


def unreadable(numbers: Numbers) -> list[str]:
    """Components that the action has and that could not be read."""
    return [item.component for item in numbers.components if item.state == "unreadable"]


def looked_in(numbers: Numbers) -> str:
    """In words: where modes were looked for, and why not elsewhere."""
    seen = [item.component for item in numbers.components if item.state == "varies"]
    rest = [
        f"{item.component} {NOT_LOOKED_AT[item.state]}"
        for item in numbers.components
        if item.state in NOT_LOOKED_AT and item.state != "absent"
    ]
    rest += [
        f"the action has no {item.component}"
        for item in numbers.components
        if item.state == "absent" and item.component != OTHER
    ]
    words = " and ".join(filter(None, [", ".join(seen[:-1]), *seen[-1:]])) or "no component"
    return f"{words} ({'; '.join(rest)})" if rest else words


def beside(numbers: Numbers, red: Topic) -> tuple[str, ...]:
    """What bounds a cause that speaks of modes: where they were looked for, and what else is there.

    Returns:
        A sentence each; none of a cause that speaks of no modes.
    """
    if red not in SPEAK_OF_MODES or not numbers.components:
        return ()
    looked = f"Modes were looked for in {looked_in(numbers)}, of each component by itself."
    return tuple(filter(None, [looked, others(numbers, red).strip()]))


def others(numbers: Numbers, red: Topic) -> str:
    """What was found beside the component that was followed, a sentence; empty where nothing."""
    found = [item for item in numbers.components if item.two_mode and not item.followed]
    if not found or red not in SPEAK_OF_MODES:
        return ""
    listed = ", ".join(f"{item.component} ({item.two_mode_episodes} episodes)" for item in found)
    return (
        f" This is about the modes of {followed(numbers)}; others were found in {listed}, and "
        "nothing is said of what decides them or whether they succeed."
    )


def _answer(item: ComponentModes) -> Answer:
    looked = item.state == "varies"
    if looked:
        note = f"from {item.separation:.3g} {item.unit} apart on"
        if item.spread is not None:
            note += f", usual spread {item.spread:.3g} {item.unit}"
        note += "; the rest of the audit is about these" if item.followed else ""
    else:
        note = f"not looked at: {NOT_LOOKED_AT.get(item.state, item.state)}"
    return Answer(
        "component_modes", Topic.STRUCTURE,
        f"held-out episodes with several modes of {item.component}",
        float(item.two_mode_episodes) if looked else None, None, ">=", note=note,
    )  # fmt: skip
