"""The plan of a recording session: every choice of every episode, from its own named stream.

Nothing here simulates. Each choice (side, operator, kind, object, start) has its own stream, so
that the side cannot depend on anything that is observed; epochs follow one another in time.
"""

from collections.abc import Callable, Mapping

import numpy as np

from genpolicy.errors import ConfigError
from genpolicy.seeds import stream
from genpolicy.tasks.api import EpisodeSpec
from genpolicy.tasks.tabletop_insertion.experts import KINDS, SIDES, STYLES
from genpolicy.tasks.tabletop_insertion.probes import EPOCHS
from genpolicy.tasks.tabletop_insertion.start import InsertionStart, sample_start

# How the kinds are shared out; the numbers sum to 1.
DEFAULT_SHARES: dict[str, float] = {
    "nominal": 0.72, "pushed": 0.12, "wander": 0.08, "missed": 0.04, "dropped": 0.04,
}  # fmt: skip
# Names of pegs of one drawing; physically equal, a stratum that must not explain anything.
OBJECTS = ("peg_a", "peg_b")
FIRST_EPISODE_NS = 1_770_000_000_000_000_000
EPISODE_SPACING_NS = 60_000_000_000


def episode_specs(
    root_seed: int,
    episodes: int,
    *,
    shares: Mapping[str, float] | None = None,
    draw_start: Callable[[np.random.Generator], InsertionStart] = sample_start,
) -> list[EpisodeSpec]:
    """Plan `episodes` episodes, in order of time.

    Args:
        root_seed: Seed of the session.
        episodes: How many, >= 1.
        shares: Share of each kind of episode; kinds left out do not occur.
        draw_start: Draws where an episode begins.

    Raises:
        ConfigError: A share is negative, of an unknown kind, or they do not sum to 1.
    """
    table = _checked(DEFAULT_SHARES if shares is None else shares)
    kinds, weights = list(table), np.array(list(table.values()))
    epochs = list(EPOCHS)
    operators = list(STYLES)
    specs = []
    for index in range(episodes):
        specs.append(
            EpisodeSpec(
                root_seed=root_seed,
                index=index,
                kind=kinds[int(_draw(root_seed, index, "kind").choice(len(kinds), p=weights))],
                operator=operators[
                    int(_draw(root_seed, index, "operator").integers(len(operators)))
                ],
                object_name=OBJECTS[int(_draw(root_seed, index, "object").integers(len(OBJECTS)))],
                calibration_epoch=epochs[index * len(epochs) // episodes],
                mode=SIDES[int(_draw(root_seed, index, "side").integers(2))],
                start=draw_start(_draw(root_seed, index, "start")),
                start_time_ns=FIRST_EPISODE_NS + index * EPISODE_SPACING_NS,
            )
        )
    return specs


def _draw(root_seed: int, index: int, what: str) -> np.random.Generator:
    return stream(root_seed, "session", index, what)


def _checked(shares: Mapping[str, float]) -> dict[str, float]:
    known = {kind: float(shares[kind]) for kind in KINDS if kind in shares}
    valid = len(known) == len(shares) and all(value >= 0 for value in known.values())
    if not (valid and abs(sum(known.values()) - 1.0) <= 1e-9):
        raise ConfigError(
            where="the shares of the kinds of episode",
            found=f"{dict(shares)}",
            expected=f"shares >= 0 of {list(KINDS)} that sum to 1",
            action="Correct the shares in params.yaml.",
        )
    return known
