"""Which columns come of an episode instead of before it, told by their names.

What counts rows, episodes or files, and what judges an episode or measures its end, is no reason
why demonstrations differ: a longer way has more rows, and a lamp that it ends at another place.
Every part of a path is asked, `success/stage_1` and `episode_stats.r` as `success`.
"""

import re

from genpolicy.data.formats.units import tokens

COUNTERS = {
    *("index", "frame_index", "step_index", "episode_index", "frame", "step", "timestamp"),
    *("episode_uuid", "num_samples", "rows", "n_rows", "chunk_index", "file_index", "frames"),
}
JUDGES = {
    *("reward", "rewards", "done", "dones", "terminal", "terminals", "terminated", "truncated"),
    *("truncation", "truncations", "termination", "terminations"),
    *("success", "successes", "succeeded", "outcome", "outcomes"),
    *("fail", "failed", "failure", "failures", "discount", "quality", "rating", "ratings"),
    *("metric", "metrics", "stats", "statistics", "result", "results"),
}
"""Words of what comes of an episode, wherever they end a part of a name (`is_success`)."""
OF_A_JUDGE = {
    *("reason", "cause", "flag", "label", "code", "terms", "count", "number", "time", "frame"),
    *("at", "first", "last", "prob", "probability", "likelihood", "confidence", "predicted"),
}
"""Words that say no more beside one of these (`termination_reason`, `success_prob`)."""
MEASURES = {
    *("return", "returns", "ret", "rew", "score", "length", "len", "duration", "grade"),
    *("timeout", "timeouts", "mask", "next"),
}
"""Words that are one only by themselves: the length of a tool decides, that of an episode not."""
OF_AN_EPISODE = {
    *("episode", "episodes", "ep", "traj", "trajectory", "step", "steps", "action", "actions"),
    *("total", "sum", "mean", "max", "min", "cumulative", "final", "rate", "is", "was", "per"),
    *("valid", "pad", "padding", "attention", "loss", "sparse", "dense", "shaped", "env"),
    *("demo", "demonstration", "rollout", "path"),
}
"""Words that say nothing else beside one of these."""
HOLDERS = {"info", "infos", "meta", "metadata", "data", "extra", "extras", "log", "logs", "attrs"}
"""Words of what holds anything: `info/length` is that of the episode, `tool/length` is not."""
HOW_MANY = {"num", "n", "nb", "nr", "number", "count", "total", "elapsed", "of"}
WHOSE = {"episode", "ep", "traj", "trajectory", "demo", "demonstration", "rollout"}
COUNTED = {
    *("step", "steps", "frame", "frames", "row", "rows", "samples", "timestep", "timesteps"),
    *("transitions", "ticks"),
}
"""`num_steps`, `elapsed_time`, `episode_frames`; a `sample_number` may be that of a material."""
EVENTS = {
    *("collision", "collisions", "attempt", "attempts", "retry", "retries", "regrasp", "regrasps"),
    *("violation", "violations", "intervention", "interventions", "correction", "corrections"),
}
"""What happens in an episode: `n_collisions`, `retry_count`; how many objects there are decides."""
ERRORS = {"error", "errors", "err", "deviation", "residual", "rmse", "mse"}
OF_FOLLOWING = {
    *("tracking", "following", "control", "servo", "trajectory", "path", "placement", "insertion"),
    *("position", "pos", "orientation", "pose", "rotation", "joint", "tcp", "ee", "eef"),
    *("max", "mean", "avg", "average", "rms", "peak", "median", "std", "total", "m", "mm", "rad"),
}
"""How far the arm was from where it should be: `tracking_error`, `rms_position_error_mm`."""
STATISTICS = {
    *("max", "maximum", "min", "minimum", "mean", "avg", "average", "peak", "rms", "std"),
    *("median", "total", "cumulative", "integral", "p95", "p99"),
}
MEASURED = {
    *("force", "torque", "wrench", "effort", "current", "power", "energy", "work", "pressure"),
    *("speed", "velocity", "vel", "acceleration", "accel", "jerk", "smoothness", "curvature"),
    *("distance", "displacement", "travel", "clearance", "tilt", "contact"),
}
OF_AN_ARM = {
    *("tcp", "ee", "eef", "joint", "joints", "gripper", "arm", "tool", "wrist", "left", "right"),
    *("linear", "angular", "rotational", "abs", "absolute", "norm", "x", "y", "z", "xy", "xyz"),
    *("n", "nm", "m", "mm", "rad", "deg", "s", "a", "w", "j"),
}
TAKEN = {"total", "elapsed", "execution", "completion", "finish", "stop"}
"""Words of how long it took, beside `time`."""
ENDINGS = ("last", "end", "terminal")
AT_THE_END = {
    *("pose", "poses", "state", "states", "position", "positions", "pos", "distance", "dist"),
    *("error", "reward", "score", "time", "timestamp", "step", "frame", "row", "index", "height"),
    *("angle", "orientation", "rotation", "velocity", "obs", "observation", "info", "joint"),
    *("joints", "qpos"),
}
"""What is measured where an episode ends; an `end_effector` and a `final_goal` are not."""
WISHES = {"goal", "target"}
TIME_UNITS = {"s", "sec", "secs", "second", "seconds", "ms", "us", "ns", "minutes"}
OF_GYMNASIUM = {"r", "l", "t"}
"""Return, length and time of an `episode`."""
ENDS = {("from", "index"), ("to", "index"), ("timed", "out"), ("time", "out")}
FLAGS = ("is_first", "is_last", "is_terminal")


def may_be_reason(name: str) -> bool:
    """Whether a column of this name may be why demonstrations differ."""
    if counts_rows(name):
        return False
    parts = [words for part in re.split(r"[/.\[\]]+", name) if (words := tokens(part))]
    if any(_is_judge(words) for words in parts):
        return False
    if any(_is_of_gymnasium(parts[k - 1], parts[k]) for k in range(1, len(parts))):
        return False
    if any(_is_count(words) or _is_ending(words) for words in parts):
        return False
    ends = [
        [word for part in parts[k:] for word in part]
        for k in range(len(parts))
        if all(map(_holds_any, parts[:k]))
    ]
    return not any(_is_judge(words) or _is_measure(words) for words in ends)


def is_called_measured(name: str) -> bool:
    """Whether its name is that of a statistic of motion or load (`max_force_n`, `mean_tcp_speed`).

    It may as well be a limit that somebody set: its values tell. A setting comes again, a
    measurement is another in each episode.
    """
    parts = [words for part in re.split(r"[/.\[\]]+", name) if (words := tokens(part))]
    named = [said for words in parts if (said := {w for w in words if not w.isdigit()})]
    said = named[-1] if named else set()
    whole = said <= STATISTICS | MEASURED | OF_AN_ARM
    return whole and bool(said & STATISTICS) and bool(said & MEASURED)


def counts_rows(name: str) -> bool:
    """Whether it is one of the columns with which layouts number rows, episodes and files."""
    plain = name.lower().removeprefix("observation.")
    last = re.split(r"[/.]", plain)[-1]
    numbers = plain in COUNTERS or (last in COUNTERS and "_" in last)
    return numbers or plain in FLAGS or tuple(tokens(name)[-2:]) in ENDS


def _is_judge(words: list[str]) -> bool:
    """Whether a part of a name judges, so that what lies below it does too."""
    plain = [word for word in words if not word.isdigit()]
    judging = JUDGES & {*plain}
    ends = bool(JUDGES & {*plain[-1:]})
    return ends or bool(judging and {*plain} <= JUDGES | OF_A_JUDGE | OF_AN_EPISODE)


def _is_measure(words: list[str]) -> bool:
    """Whether a name measures an episode."""
    said = {*_plain(words)}
    return bool(said & MEASURES) and said <= JUDGES | MEASURES | OF_AN_EPISODE


def _is_count(words: list[str]) -> bool:
    said = {*_plain(words)}
    if "time" in said:
        return bool(said & TAKEN) and said <= TAKEN | WHOSE | {"time"}
    if said & ERRORS:
        return bool(said & OF_FOLLOWING) and said <= ERRORS | OF_FOLLOWING | WHOSE
    counted = said & (COUNTED | EVENTS) and said & (HOW_MANY | WHOSE)
    return bool(counted) and said <= COUNTED | EVENTS | HOW_MANY | WHOSE


def _is_ending(words: list[str]) -> bool:
    """Whether it is what was measured last; a goal is wished for, and an effector is a tool."""
    plain = _plain(words)
    if len(plain) < 2 or WISHES & {*plain}:
        return False
    if plain[0] == "final":
        return plain[-1] in AT_THE_END
    return plain[0] in ENDINGS and {*plain[1:]} <= AT_THE_END


def _plain(words: list[str]) -> list[str]:
    """The words without numbers and without the unit of a time at their end."""
    plain = [word for word in words if not word.isdigit()]
    return plain[:-1] if len(plain) > 1 and plain[-1] in TIME_UNITS else plain


def _holds_any(words: list[str]) -> bool:
    return words[-1] in HOLDERS or {*words} <= WHOSE | {"next", "observation", "mask"}


def _is_of_gymnasium(above: list[str], word: list[str]) -> bool:
    return above[-1] in WHOSE and len(word) == 1 and word[0] in OF_GYMNASIUM
