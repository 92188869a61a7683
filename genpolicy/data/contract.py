"""What a recording must satisfy to become part of a dataset, and what a dataset says of itself."""

from collections.abc import Mapping
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from genpolicy.contract.action import ACTION_COMPONENTS, action_contract_hash
from genpolicy.contract.observation import ObservationContract
from genpolicy.data.recording.episode import JOINTS_STREAM, ROBOT_STREAM
from genpolicy.errors import ConfigError
from genpolicy.integrity.documents import canonical_json
from genpolicy.integrity.hashing import sha256_bytes

Array = NDArray[np.float64]

FORCE_BOUND_N = 1000.0
UNIT_BOUND = 1.0 + 1e-6
ANGLE_BOUND_RAD = 2.0 * np.pi + 1e-6
RANGE_MARGIN_M = 0.1


@dataclass(frozen=True)
class ActionContract:
    """The numbers of one action.

    Attributes:
        frame: Frame they are expressed in.
        components: Name of each number.
        units: Unit of each number.
        sha256: Hash of the definition; computed from the other fields if absent.
    """

    frame: str
    components: tuple[str, ...]
    units: tuple[str, ...]
    sha256: str = ""

    def __post_init__(self) -> None:
        if len(self.units) != len(self.components) or not self.components:
            raise ConfigError(
                where="action contract: units",
                found=f"{len(self.units)} of them",
                expected=f"one for each of {len(self.components)} components",
                action="Name the unit of every component.",
            )
        if not self.sha256:
            body = {
                "frame": self.frame,
                "components": list(self.components),
                "units": list(self.units),
            }
            object.__setattr__(self, "sha256", sha256_bytes(canonical_json(body)))

    @property
    def dim(self) -> int:
        """Length of the action vector."""
        return len(self.components)


TCP_ACTION = ActionContract(
    frame="robot_base",
    components=ACTION_COMPONENTS,
    units=("m",) * 3 + ("1",) * 6 + ("m",),
    sha256=action_contract_hash(),
)


@dataclass(frozen=True)
class SplitRule:
    """By episode and causal in time: the earliest train, the latest test.

    Attributes:
        train: Share of the episodes, rounded down.
        validation: Share of the episodes, rounded down but at least one; the rest is the test.
    """

    train: float = 0.7
    validation: float = 0.15

    def __post_init__(self) -> None:
        if not (self.train > 0 and self.validation > 0 and self.train + self.validation < 1):
            raise ConfigError(
                where="split fractions",
                found=f"train {self.train}, validation {self.validation}",
                expected="positive shares that leave some for the test",
                action="Correct the split fractions in params.yaml.",
            )


@dataclass(frozen=True)
class IngestContract:
    """The contract that every recording is held against.

    Attributes:
        observation: Channels of the observation; a stream's samples are its channels in order.
            A channel of the stream `phase` is the one-hot of `phases`.
        phases: Known phases, in the order of the one-hot channel.
        action: The action.
        action_period_s: Time between actions, s.
        ranges: Plausible values by `channel.component` or `action.component`, in contract
            units; a number outside is a unit error. See `plausible_ranges`.
        joint_range_rad: Lower and upper joint limits, rad, for recordings with a `joints` stream.
        motion_streams: Streams that must change while the action moves.
        maximum_gap_s: Longest time between two samples of a stream.
        maximum_lead_s: The first actions that lack a first observation may span this long; they
            are counted in `lead_rows` and become no frames.
        minimum_rows: A recording of fewer actions is no demonstration.
        clock_tolerance_s: A sample may seem received this much before it was exposed.
        frozen_s: A sensor bit-constant for this long, while the action moves, is frozen.
        frozen_motion: How far a component of the action must move for that, in its unit.
    """

    observation: ObservationContract
    phases: tuple[str, ...]
    action: ActionContract = TCP_ACTION
    action_period_s: float = 0.05
    ranges: Mapping[str, tuple[float, float]] = field(default_factory=dict)
    joint_range_rad: tuple[tuple[float, ...], tuple[float, ...]] | None = None
    motion_streams: tuple[str, ...] = (ROBOT_STREAM, JOINTS_STREAM)
    maximum_gap_s: float = 0.25
    maximum_lead_s: float = 0.25
    minimum_rows: int = 2
    clock_tolerance_s: float = 0.001
    frozen_s: float = 0.5
    frozen_motion: float = 0.01


def plausible_ranges(
    observation: ObservationContract,
    action: ActionContract,
    *,
    workspace_lower_m: Array,
    workspace_upper_m: Array,
) -> dict[str, tuple[float, float]]:
    """Ranges that catch a wrong unit: mm for m, degrees for radians, a missing normalisation.

    Components named x, y, z must lie in the workspace with 0.1 m of room, other lengths within
    its largest coordinate with that room, pure numbers within ±1, angles within ±2 pi, forces
    within ±1000 N. Units without a rule are not checked.

    Args:
        observation: The observation contract.
        action: The action contract.
        workspace_lower_m: Lower corner, m. Shape (3,).
        workspace_upper_m: Upper corner, m. Shape (3,).

    Returns:
        Lower and upper bound by `channel.component` and `action.component`.
    """
    axes = {
        axis: (float(low) - RANGE_MARGIN_M, float(high) + RANGE_MARGIN_M)
        for axis, low, high in zip("xyz", workspace_lower_m, workspace_upper_m, strict=True)
    }
    reach = max(max(abs(low), abs(high)) for low, high in axes.values())
    result: dict[str, tuple[float, float]] = {}
    for channel in observation.channels:
        for component in channel.components:
            bounds = _bounds(component, channel.unit, axes, reach)
            if bounds is not None:
                result[f"{channel.name}.{component}"] = bounds
    for component, unit in zip(action.components, action.units, strict=True):
        bounds = _bounds(component, unit, axes, reach)
        if bounds is not None:
            result[f"action.{component}"] = bounds
    return result


def _bounds(
    component: str, unit: str, axes: Mapping[str, tuple[float, float]], reach: float
) -> tuple[float, float] | None:
    if unit == "m" or component.endswith("_m"):
        axis = component.removesuffix("_m").rsplit("_", 1)[-1]
        return axes.get(axis, (-reach, reach))
    known = {"1": UNIT_BOUND, "rad": ANGLE_BOUND_RAD, "N": FORCE_BOUND_N}
    return (-known[unit], known[unit]) if unit in known else None
