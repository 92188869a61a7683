"""What moves the arm in simulation is held to the limits that are pinned for the wall clock.

`limits.yaml` is pinned byte by byte; `params.yaml` is what the virtual clock reads. They say the
same, or the ladder stops before the first action: a limit that moves in one of them alone is a
limit that nobody reviewed. A rehearsal may differ, and leads to no card.
"""

from pathlib import Path
from typing import Any

from genpolicy.errors import ConfigError
from genpolicy.execution.cell import ExecutionSettings
from genpolicy.feasibility.settings import FeasibilitySettings
from genpolicy.wall_clock.limits import LIMITS, read_limits
from stages._stage import PARAMS, Params

REHEARSAL = "rehearsal"
"""Read here and not by `gates.protection`: a floor that moves would run shadow and stress again."""
ONE_CLOCK = ("silence_stop_s", "term_deadlines")
"""Settings of `execution` that only one of the two clocks has."""


def require_pinned_limits(params: Params, root: Path) -> None:
    """Refuse limits of horizons, executor or layers that are not those that are pinned.

    Limits that are pinned for another task say nothing of this one.

    Args:
        params: The parameters that the stage runs with.
        root: Workspace with `limits.yaml` and `fixtures.yaml`.

    Raises:
        ConfigError: `limits.yaml` is missing or not as pinned, or a setting of `params.yaml` is
            another one than there.
        IntegrityError: It is no regular file.
    """
    if params.raw.get(REHEARSAL) is True:  # what is neither true nor false stage `task` refuses
        return
    if not (root / LIMITS).exists():
        raise ConfigError(
            where=LIMITS,
            found="missing",
            expected=f"the limits that {PARAMS} states, as a person reviewed and pinned them",
            action="Restore it, or write task, horizons, execution and feasibility into it and pin "
            "it with `genpolicy fixtures --pin`.",
        )
    pinned = read_limits(root)
    if pinned.task != params.task.name:
        return
    stated = {
        "horizons": params.horizons,
        "execution": params.section("execution", ExecutionSettings),
        "feasibility": params.section("feasibility", FeasibilitySettings),
    }
    for name, section in stated.items():
        now, then = section.model_dump(), getattr(pinned, name).model_dump()
        for key in sorted({*now, *then} - {*ONE_CLOCK}):
            if now.get(key) != then.get(key):
                _refuse(f"{name}.{key}", now.get(key), then.get(key))


def _refuse(place: str, found: Any, expected: Any) -> None:
    raise ConfigError(
        where=f"{PARAMS}: {place}",
        found=f"{found!r:.80}",
        expected=f"{expected!r:.80}, as pinned in {LIMITS}",
        action=f"Restore it; or review the change, write it into {LIMITS} as well, pin it with "
        "`genpolicy fixtures --pin`, and write the plan again (`genpolicy gates preregister`) "
        "before there is evidence.",
    )
