"""Calibration epochs and out-of-distribution probes of the cell, each a few named numbers."""

import math
from dataclasses import dataclass, field
from typing import TypeVar

from genpolicy.errors import ConfigError
from genpolicy.tasks.api import NOMINAL_PROBE
from genpolicy.tasks.tabletop_insertion.scene import Variant

T = TypeVar("T")


@dataclass(frozen=True)
class CameraError:
    """What the camera's estimate of hole and post is off by, base frame.

    Attributes:
        x_m: Shift.
        y_m: Shift.
        yaw_rad: Turn of the hole's yaw.
        noise_m: Standard deviation of white noise on every position.
    """

    x_m: float = 0.0
    y_m: float = 0.0
    yaw_rad: float = 0.0
    noise_m: float = 0.0


@dataclass(frozen=True)
class Epoch:
    """One calibration of the cell.

    Attributes:
        camera: Systematic camera error that the calibration left.
        clock_offset_s: By how much each stream's clock runs ahead of the host's.
    """

    camera: CameraError
    clock_offset_s: dict[str, float]


@dataclass(frozen=True)
class Probe:
    """One way to leave the distribution of the demonstrations.

    Attributes:
        camera: Camera error on top of the epoch's.
        variant: Physical differences.
    """

    camera: CameraError = field(default_factory=CameraError)
    variant: Variant = field(default_factory=Variant)

    def graded(self, severity: float) -> "Probe":
        """The same probe, so many times as far from nominal."""
        return Probe(
            CameraError(**{name: severity * value for name, value in vars(self.camera).items()}),
            Variant(
                **{
                    name: 1.0 + severity * (value - 1.0)
                    for name, value in vars(self.variant).items()
                }
            ),
        )


EPOCHS: dict[str, Epoch] = {
    "epoch_1": Epoch(
        CameraError(0.0006, -0.0004, 0.003),
        {"robot": -0.0212, "force": 0.0135, "camera": 0.1370, "action": 0.0},
    ),
    "epoch_2": Epoch(
        CameraError(-0.0005, 0.0007, -0.004),
        {"robot": -0.0187, "force": 0.0151, "camera": -0.0840, "action": 0.0},
    ),
    "epoch_3": Epoch(
        CameraError(0.0002, 0.0005, 0.002),
        {"robot": 0.0094, "force": -0.0063, "camera": 0.0420, "action": 0.0},
    ),
}

PROBES: dict[str, Probe] = {
    NOMINAL_PROBE: Probe(),
    "calibration_shift": Probe(camera=CameraError(0.0030, -0.0025, 0.03)),
    "unseen_object": Probe(variant=Variant(peg_width_scale=1.15, peg_mass_scale=2.5)),
    "lighting": Probe(camera=CameraError(noise_m=0.0025)),
    "contact_anomaly": Probe(variant=Variant(friction_scale=2.5)),
}


def find_epoch(name: str) -> Epoch:
    """The epoch of a name.

    Raises:
        ConfigError: There is none.
    """
    return _find(EPOCHS, name, "the calibration epoch")


def find_probe(name: str) -> Probe:
    """The probe of a name, `<probe>` or `<probe>@<severity>`.

    Raises:
        ConfigError: There is none, or the severity is no positive number.
    """
    plain, graded, severity = name.partition("@")
    probe = _find(PROBES, plain, "the probe")
    return probe.graded(_severity(severity, name)) if graded else probe


def _severity(text: str, name: str) -> float:
    try:
        value = float(text)
    except ValueError:
        value = math.nan
    if not 0.0 < value < math.inf:
        raise ConfigError(
            where=f"the severity of the probe {name!r}",
            found=repr(text),
            expected="a positive number",
            action="Give one behind the `@`, or leave out both.",
        )
    return value


def _find(table: dict[str, T], name: str, where: str) -> T:
    if name not in table:
        raise ConfigError(
            where=where,
            found=repr(name),
            expected=f"one of {sorted(table)}",
            action="Name one that the task defines.",
        )
    return table[name]
