"""The rule by which a candidate that can no longer pass is stopped, from what is planned.

A limit may move after the rollouts, and an exception to it may be written; neither may make a stop
wrong that was right. So a count is held against the loosest limit that the code lets anybody write
(`gates.floors`), and drawn with the least confidence. A rehearsal may go beyond these, so that the
gain alone stops anybody there, whose limit nobody may override.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Literal

from genpolicy.errors import ConfigError

What = Literal["success", "intervention", "reset"]

NOMINAL = "nominal"
"""The undisturbed condition, of which another limit holds than of the others."""
COUNTED: tuple[tuple[str, What, float], ...] = (
    ("reset_upper", "reset", 0.1),
    ("intervention_upper", "intervention", 0.2),
    ("nominal_success_lower", "success", 0.2),
    ("stress_success_lower", "success", 0.05),
)
"""Criteria that bound a count of starts in each condition, what they count, and the loosest limit.
Not imported: the stage would stand on all that judges. A test holds both to what the gates say."""
CONFIDENCE = 0.9
"""The least that an interval may cover, likewise."""
UNWEIGHED = "all starts in one block where costs are weighed: who is stopped is told by success"
"""What a plan may not be: rollouts are counted by success, and a weight may move after them."""


@dataclass(frozen=True)
class Counted:
    """A bound that counts starts, and must hold in each of some conditions.

    Attributes:
        criterion: Which criterion has the bound.
        what: What is counted: successes, which are good, or what is bad.
        conditions: Where.
        limit: The loosest that anybody may set: of successes a lower bound is at least that, of
            what is bad an upper bound at most.
    """

    criterion: str
    what: What
    conditions: tuple[str, ...]
    limit: float


@dataclass(frozen=True)
class Rule:
    """What is planned, as far as it says who can still pass.

    Attributes:
        starts: Planned starts.
        block: Starts after which it is asked who is out; smaller than `starts`.
        conditions: Names of those that are judged.
        simple: Names of the simple methods.
        margin: Gain to be shown over each of them.
        alpha: Share of the error that one candidate may spend.
        counted: Bounds of counts.
        confidence: The least coverage that an interval may have.
    """

    starts: int
    block: int
    conditions: tuple[str, ...]
    simple: tuple[str, ...]
    margin: float
    alpha: float
    counted: tuple[Counted, ...]
    confidence: float

    @property
    def ends(self) -> tuple[int, ...]:
        """Starts that are run at the end of each block; the last one may be shorter."""
        return (*range(self.block, self.starts, self.block), self.starts)

    def number(self, ran: int) -> int | None:
        """Number of the block, from 1, that ends with so many starts; None where none does."""
        return self.ends.index(ran) + 1 if ran in self.ends else None


def planned_rule(
    *,
    starts: int,
    block: int | None,
    conditions: Sequence[str],
    simple: Sequence[str],
    margin: float,
    alpha: float,
    rehearsal: bool,
    costs: bool = False,
) -> Rule | None:
    """The rule of a plan; None where all starts are one block.

    Args:
        starts: As of `Rule`.
        block: Starts of a block; None, or not below `starts`: all of them.
        conditions: As of `Rule`.
        simple: As of `Rule`.
        margin: As of `Rule`.
        alpha: As of `Rule`.
        rehearsal: Whether limits may be looser than the loosest.
        costs: Whether a success is weighed against its costs.

    Raises:
        ConfigError: Costs are weighed, so that successes do not say who can still pass.
    """
    if block is None or block >= starts:
        return None
    if costs:
        raise ConfigError(
            where="params.yaml: stress.block",
            found=f"{block} of {starts} starts, with gate_d.utility",
            expected=UNWEIGHED,
            action="Leave out stress.block, or gate_d.utility.",
        )
    return Rule(
        starts=starts,
        block=block,
        conditions=tuple(conditions),
        simple=tuple(simple),
        margin=margin,
        alpha=alpha,
        counted=() if rehearsal else _loosest(conditions),
        confidence=CONFIDENCE,
    )


def weighed(section: object) -> bool:
    """Whether the section of Gate D weighs a success against its costs; what is none weighs none.

    Args:
        section: `gate_d` of `params.yaml`, as it stands there.
    """
    return isinstance(section, Mapping) and bool(section.get("utility"))


def _loosest(conditions: Sequence[str]) -> tuple[Counted, ...]:
    disturbed = tuple(name for name in conditions if name != NOMINAL)
    where = {"nominal_success_lower": (NOMINAL,), "stress_success_lower": disturbed}
    return tuple(
        Counted(criterion, what, where.get(criterion, tuple(conditions)), limit)
        for criterion, what, limit in COUNTED
    )
