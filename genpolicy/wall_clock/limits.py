"""Limits of the wall-clock mode: one file, pinned byte by byte, read once and by the hash.

They are those of `params.yaml`, and one more that a wall clock needs: the silence that stops. The
bytes that are hashed are the bytes that are parsed, so that nothing can change in between.
"""

from pathlib import Path
from typing import Any, NoReturn

import yaml

from genpolicy.contract.horizons import HorizonConfig
from genpolicy.contract.settings import Settings, parse_settings
from genpolicy.errors import ConfigError
from genpolicy.execution.cell import Cell, ExecutionSettings
from genpolicy.feasibility.settings import FeasibilitySettings
from genpolicy.integrity.atomic import write_bytes
from genpolicy.integrity.documents import parse_yaml, read_yaml
from genpolicy.integrity.hashing import sha256_bytes_of, sha256_file
from genpolicy.tasks.fixtures import HEADER, PINS, fixture_hashes, require_pinned
from genpolicy.tasks.identity import task_identity

LIMITS = "limits.yaml"
"""The file, from the root of a workspace."""
SECTION = "wall_clock"
"""Where its pin stands in `fixtures.yaml`."""


class WallClockLimits(Settings):
    """Everything that a run on a wall clock is held to.

    Attributes:
        task: Name of the task that the limits are for.
        horizons: H_o, K, H_e and the period.
        execution: Of executor, stub and supervisor; `silence_stop_s` must be given.
        feasibility: Thresholds of the six layers.
    """

    task: str
    horizons: HorizonConfig
    execution: ExecutionSettings
    feasibility: FeasibilitySettings

    @property
    def silence_stop_s(self) -> float:
        """Silence after which the supervisor stops, s."""
        silence_s = self.execution.silence_stop_s
        assert silence_s is not None, "read_limits refuses limits without it"
        return silence_s

    @property
    def cell(self) -> Cell:
        """What executor, stub and supervisor are held to."""
        return Cell(self.horizons, self.execution)


def read_limits(root: Path) -> WallClockLimits:
    """The limits of a workspace, if they and the fixtures of their task are as pinned.

    Args:
        root: Workspace with `limits.yaml` and `fixtures.yaml`.

    Raises:
        IntegrityError: No such file.
        ConfigError: A byte of it is another than was pinned, a fixture of the task is, or what
            stands there are no limits.
    """
    found, data = sha256_bytes_of(root / LIMITS, keep=True)
    _require(root, found)
    document = parse_yaml(data, where=LIMITS)
    if not isinstance(document, dict):
        _refuse(f"of type {type(document).__name__}", "the limits by name")
    limits = parse_settings(WallClockLimits, document, where=LIMITS)
    if limits.execution.silence_stop_s is None:
        _refuse("without execution.silence_stop_s", "the silence after which the supervisor stops")
    require_pinned(root, limits.task, fixture_hashes(task_identity(limits.task)))
    return limits


def require_limits(root: Path) -> None:
    """Refuse limits that are not as pinned; where there are neither, there is no wall-clock mode.

    Raises:
        ConfigError: Another byte, no pin, or no file.
        IntegrityError: The file is none.
    """
    if (root / LIMITS).exists() or _pinned(root) is not None:
        _require(root, sha256_file(root / LIMITS))


def pin_limits(root: Path) -> dict[str, str]:
    """Pin the limits as they are now, if there are any.

    Returns:
        The pinned hash by file; empty without the file.
    """
    if not (root / LIMITS).exists():
        return {}
    found = {LIMITS: sha256_file(root / LIMITS)}
    write_bytes(root / PINS, (HEADER + yaml.safe_dump({**_pins(root), SECTION: found})).encode())
    return found


def _require(root: Path, found: str) -> None:
    stated = _pinned(root)
    if stated is None:
        _refuse(f"{found[:16]}… now", f"a hash in {PINS}: {SECTION}")
    if stated != found:
        _refuse(f"{found[:16]}… now", f"{str(stated)[:16]}… as pinned")


def _pinned(root: Path) -> Any:
    section = _pins(root).get(SECTION)
    return section.get(LIMITS) if isinstance(section, dict) else section


def _pins(root: Path) -> dict[str, Any]:
    pins = read_yaml(root / PINS) if (root / PINS).exists() else {}
    return pins if isinstance(pins, dict) else {}


def _refuse(found: str, expected: str) -> NoReturn:
    raise ConfigError(
        where=LIMITS,
        found=found,
        expected=expected,
        action="Restore the file, or review the change and run `genpolicy fixtures --pin`.",
    )
