"""How hard a planned disturbance must be at least: fixed here, as those of `gates.floors`.

A condition of the right kind with a probability and a size of next to nothing is met by anybody,
and would be counted as withstood.
"""

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from typing import Any

PLACE = "stress.perturbations"


@dataclass(frozen=True)
class Mildest:
    """The least of a disturbance that is one.

    Attributes:
        kind: Kind of the condition.
        least: The least value of each of its fields, by name.
        reason: Why less is no disturbance.
    """

    kind: str
    least: Mapping[str, float]
    reason: str


MILDEST: tuple[Mildest, ...] = (
    Mildest(
        "camera_delay",
        {"probability": 0.5, "magnitude_s": 0.05},
        "a picture that is late by less than an action period is not late",
    ),
    Mildest(
        "compute_contention",
        {"probability": 0.2, "factor": 2.0},
        "another program on the same core halves its speed",
    ),
    Mildest(
        "network_jitter",
        {"probability": 0.2, "magnitude_s": 0.05},
        "less than an action period of delay moves no action",
    ),
    Mildest(
        "frame_drop",
        {"probability": 0.05},
        "one lost picture in a rollout is what a camera loses on a good day",
    ),
    Mildest(
        "policy_stall",
        {"probability": 0.02, "magnitude_s": 0.1},
        "a policy that hangs for less than two action periods is a slow one",
    ),
    Mildest(
        "queue_reorder",
        {"probability": 0.02, "magnitude_s": 0.1},
        "a chunk that waits for less than two action periods is not overtaken",
    ),
    Mildest("push", {"force_n": 5.0}, "a hand that leans on the arm pushes as hard"),
)


def too_mild(params: Mapping[str, Any]) -> list[tuple[Mildest, str]]:
    """Kinds of which no planned condition is hard enough, with what was found of them.

    A kind that is not planned, and a field that is not written, is no matter of this: the list of
    kinds and the settings of the stage ask for them.
    """
    section = params.get("stress")
    planned = section.get("perturbations") if isinstance(section, Mapping) else None
    if not isinstance(planned, Mapping):
        return []
    entries = {
        name: entry for name, entry in planned.items() if isinstance(entry, Mapping) and entry
    }
    found = []
    for mildest in MILDEST:
        own = {n: e for n, e in entries.items() if e.get("kind", n) == mildest.kind}
        milder = [list(_milder(name, entry, mildest)) for name, entry in own.items()]
        if milder and all(milder):
            found.append((mildest, "; ".join(text for texts in milder for text in texts)))
    return found


def _milder(name: str, entry: Mapping[str, Any], mildest: Mildest) -> Iterator[str]:
    """Fields of one condition that are below the least, in words; NaN and what is no number too."""
    for field, least in mildest.least.items():
        value = entry.get(field, least)
        number = isinstance(value, int | float) and not isinstance(value, bool)
        if not (number and value >= least):
            yield f"{name}.{field}: {value!r:.40}, least {least:g}"
