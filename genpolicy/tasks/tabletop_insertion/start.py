"""Where an episode begins: arm, hole and post, drawn independently and uniformly."""

from collections.abc import Mapping, Set
from dataclasses import asdict, dataclass, fields

import numpy as np

from genpolicy.errors import ContractError
from genpolicy.integrity.documents import canonical_json, parse_json

# Centre and half width of every drawn number (m, rad); hole and post lie in the base frame.
RANGES: dict[str, tuple[float, float]] = {
    "tcp_x_m": (0.38, 0.01),
    "tcp_y_m": (0.0, 0.015),
    "tcp_z_m": (0.15, 0.01),
    "yaw_rad": (0.0, 0.1),
    "hole_x_m": (0.65, 0.015),
    "hole_y_m": (0.0, 0.025),
    "hole_yaw_rad": (0.0, 0.25),
    "post_y_m": (0.0, 0.01),
}


@dataclass(frozen=True)
class InsertionStart:
    """Start of one episode; lengths in m, angles in rad, base frame.

    Attributes:
        tcp_x_m: TCP position.
        tcp_y_m: TCP position.
        tcp_z_m: TCP position.
        yaw_rad: Yaw of the downward-pointing tool.
        hole_x_m: Centre of the hole.
        hole_y_m: Centre of the hole.
        hole_yaw_rad: Yaw of the fixture.
        post_y_m: Lateral position of the post's axis.
    """

    tcp_x_m: float
    tcp_y_m: float
    tcp_z_m: float
    yaw_rad: float
    hole_x_m: float
    hole_y_m: float
    hole_yaw_rad: float
    post_y_m: float

    def to_json(self) -> str:
        """Canonical JSON text, for replay."""
        return canonical_json(asdict(self)).decode()


def uniform_start(
    rng: np.random.Generator, ranges: Mapping[str, tuple[float, float]]
) -> dict[str, float]:
    """Numbers by name, each uniform around its centre; drawn in the order of the names."""
    return {
        name: float(centre + half * rng.uniform(-1.0, 1.0))
        for name, (centre, half) in ranges.items()
    }


def sample_start(rng: np.random.Generator) -> InsertionStart:
    """Draw a start; each number uniform in its range, independent of the others."""
    return InsertionStart(**uniform_start(rng, RANGES))


def finite_numbers(text: str, names: Set[str]) -> dict[str, float]:
    """The numbers of a start, by name, from its JSON.

    Raises:
        ContractError: Names are missing or unknown, or a value is no finite number.
    """
    values = parse_json(text.encode(), where="scene_start")
    if not isinstance(values, dict) or set(values) != names:
        raise ContractError(
            where="scene_start",
            found=f"{text[:80]!r}",
            expected=f"an object with exactly the names {sorted(names)}",
            action="Record the episode again, or refuse it.",
        )
    for name, value in values.items():
        if isinstance(value, bool) or not isinstance(value, int | float) or not np.isfinite(value):
            raise ContractError(
                where=f"scene_start.{name}",
                found=repr(value),
                expected="a finite number",
                action="Record the episode again, or refuse it.",
            )
    return {name: float(value) for name, value in values.items()}


def start_from_json(text: str) -> InsertionStart:
    """The start that `to_json` wrote.

    Raises:
        ContractError: Names are missing or unknown, or a value is no finite number.
    """
    return InsertionStart(**finite_numbers(text, {field.name for field in fields(InsertionStart)}))
