"""In which components of the action modes were looked for, so that no verdict claims more."""

from gates.cause.answers import Answer, Topic
from gates.cause.numbers import Numbers
from genpolicy.audit.component_rows import NOT_LOOKED_AT, OTHER, ComponentModes

# The causes of these topics speak of modes, or of their absence.
SPEAK_OF_MODES = (Topic.STRUCTURE, Topic.HIDDEN, Topic.VALIDITY, Topic.NONE)


def components(numbers: Numbers) -> list[Answer]:
    """One answer for each component, without a limit: the one followed is judged beside them."""
    return [_answer(item) for item in numbers.components]


def followed(numbers: Numbers) -> str:
    """The component whose modes the counts, variables and outcomes are about."""
    return next((item.component for item in numbers.components if item.followed), "")


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
