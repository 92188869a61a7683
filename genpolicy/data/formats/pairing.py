"""Which observed number bears the name of each commanded number? What holds, numbers decide."""

from collections.abc import Sequence

from genpolicy.data.formats.contract import SI, ActionSource, ChannelSource
from genpolicy.data.formats.units import STATED, tokens

FILLERS = {
    *("position", "pos", "target", "cmd", "command", "commanded", "goal", "desired", "action"),
    *("actions", "state", "observation", "obs", "leader", "follower", "main", "measured", "data"),
    *("joint", "qpos", "abs", "absolute", "low", "dim", *STATED),
}
NUMBERED = {"joint", "qpos", "motor"}
OWN_BODY = {
    *("tcp", "eef", "ee", "robot", "robot0", "agent", "state", "qpos", "joint", "joints"),
    *("gripper", "arm", "hand", "proprio", "follower"),
}


def pair_by_name(channels: Sequence[ChannelSource], action: ActionSource) -> dict[str, str] | None:
    """Component of the action to the `channel.component` of the same name and unit.

    The whole name of the observed number is tried first, then its component alone, in channels
    that are named after the robot's own body.

    Returns:
        One to one, in the order of the action; None if no name is found on both sides.
    """
    observed = [
        (channel, component)
        for channel in channels
        if channel.transform == "none"
        for component in channel.components
    ]
    units = dict(zip(action.components, action.units, strict=True))
    result: dict[str, str] = {}
    for commanded in action.components:
        wanted = _key(commanded)
        if not wanted:
            continue
        for channel, component in _ranked(observed, wanted):
            name = f"{channel.name}.{component}"
            same_unit = SI.get(units[commanded], (units[commanded],))[0] == channel.dataset_unit
            if same_unit and name not in result.values():
                result[commanded] = name
                break
    return result or None


def _ranked(
    observed: list[tuple[ChannelSource, str]], wanted: frozenset[str]
) -> list[tuple[ChannelSource, str]]:
    own = [pair for pair in observed if OWN_BODY & set(tokens(pair[0].name))]
    whole = [pair for pair in observed if _key(f"{pair[0].name} {pair[1]}") == wanted]
    return [*whole, *(pair for pair in own if _key(pair[1]) == wanted)]


def _key(name: str) -> frozenset[str]:
    """The words of a name that tell one number from another; empty for a mere `state_3`."""
    words = frozenset(tokens(name))
    if words - FILLERS and not all(word.isdigit() for word in words - FILLERS):
        return words - FILLERS
    digits = {word for word in words if word.isdigit()}
    return words & (NUMBERED | digits) if words & NUMBERED and digits else frozenset()
