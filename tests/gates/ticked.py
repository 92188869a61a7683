"""Edited rollouts whose ticks and invocations still add up, as the comparison writes them."""

PARTS = {"action_ticks", "hold_ticks", "fallback_ticks"}


def as_it_ticked(before, frame):
    """Rollouts of which an edit sets one count of ticks or invocations, and not what follows.

    Commands take what the other ticks leave; where commands were edited, holds do. Without an
    invocation there is no command, and no answer is late or refused. A count that is no part of
    its whole stays: such an edit is meant.
    """
    if {*PARTS, "ticks", "invocations", "deadline_misses", "rejections"} - set(frame):
        return frame
    was = before.reindex(frame.index)
    same = {name: frame[name].eq(was[name]) for name in (*PARTS, "ticks", "invocations")}
    same["action_ticks"] |= was["action_ticks"].isna()  # of a row that was not there
    fewer = ~same["invocations"]
    for part in ("deadline_misses", "rejections"):
        frame[part] = frame[part].mask(fewer & (frame[part] > frame["invocations"]), 0)
    unasked = fewer & (frame["invocations"] == 0)
    frame["action_ticks"] = frame["action_ticks"].mask(unasked, 0)
    rest = frame["ticks"] - frame["hold_ticks"] - frame["fallback_ticks"]
    edited = (
        same["action_ticks"]
        & ~unasked
        & ~(same["hold_ticks"] & same["fallback_ticks"] & same["ticks"])
    )
    frame["action_ticks"] = frame["action_ticks"].mask(edited, rest.clip(lower=0))
    # Where one part takes more than all commands, the part that was not edited gives way too.
    for part, other in (("hold_ticks", "fallback_ticks"), ("fallback_ticks", "hold_ticks")):
        left = (frame["ticks"] - frame[other]).clip(lower=0)
        gives = edited & (rest < 0) & same[part]
        frame[part] = frame[part].mask(gives, frame[part].where(frame[part] < left, left))
    moved = (~same["action_ticks"] | unasked) & same["hold_ticks"]
    held = frame["ticks"] - frame["action_ticks"] - frame["fallback_ticks"]
    frame["hold_ticks"] = frame["hold_ticks"].mask(moved & (held >= 0), held)
    return frame
