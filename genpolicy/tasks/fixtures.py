"""Fixtures of a ladder, pinned by hash: controller, limits, supervisor and scene.

They are no parameters: a ladder on another controller is another experiment. So their hashes stand
in a file under version control, per task, and the ladder stops where they differ.
"""

from collections.abc import Mapping
from pathlib import Path
from typing import Any, NoReturn

import yaml

import genpolicy
from genpolicy.errors import ConfigError
from genpolicy.integrity.atomic import write_bytes
from genpolicy.integrity.documents import read_yaml
from genpolicy.integrity.hashing import sha256_file
from genpolicy.tasks.identity import task_identity

PINS = "fixtures.yaml"
"""Where the pins stand, from the root of a workspace."""

FILES = {
    "controller": "robot/impedance.py",
    "limits": "robot/limits.py",
    "supervisor": "execution/supervisor.py",
}
"""Files of the library that are fixtures; read, not imported: a task knows no supervisor."""

HEADER = """\
# Fixtures of the ladder, per task: the ladder stops where one of them differs. Another controller,
# table of limits, supervisor or scene is another experiment: review it, then pin it with
# `genpolicy fixtures --pin`.
"""


def fixture_hashes(identity: Mapping[str, Any]) -> dict[str, str]:
    """SHA-256 of the fixtures that a task runs with.

    Args:
        identity: Of the task, as `task_identity` gives it.

    Returns:
        `controller`, `limits` (code), `supervisor`, `scene` (the MJCF file and those beside it,
        if it lies outside the package) and `robot` (the table of limits).
    """
    home = Path(genpolicy.__file__).parent
    found = {name: sha256_file(home / path) for name, path in FILES.items()}
    beside = {f"scene/{name}": str(value) for name, value in identity["scene"].items()}
    scene, robot = str(identity["scene_sha256"]), str(identity["robot_sha256"])
    return {**found, "robot": robot, "scene": scene, **beside}


def require_pinned(root: Path, task: str, found: Mapping[str, str]) -> None:
    """Refuse fixtures other than the pinned ones.

    Args:
        root: Workspace with the pins.
        task: Name of the task.
        found: Its fixtures, as `fixture_hashes` gives them.

    Raises:
        ConfigError: No pins, none of this task, or a fixture that differs, is new or is gone.
    """
    pinned: Any = _pins(root).get(task)
    if not isinstance(pinned, dict):
        _refuse(task, "not pinned", "the hashes of its fixtures")
    for name in sorted({*found, *pinned}):
        if found.get(name) != pinned.get(name):
            stated, now = str(pinned.get(name, "nothing")), found.get(name, "missing")
            _refuse(f"{task}.{name}", f"{now[:16]}… now", f"{stated[:16]}… as pinned")


def pin(root: Path, task: str) -> dict[str, str]:
    """Pin the fixtures of a task as they are now; those of other tasks stay.

    Returns:
        The pinned hashes.
    """
    found = fixture_hashes(task_identity(task))
    pins = {**_pins(root), task: found}
    write_bytes(root / PINS, (HEADER + yaml.safe_dump(pins)).encode())
    return found


def _pins(root: Path) -> dict[str, Any]:
    pins = read_yaml(root / PINS) if (root / PINS).exists() else {}
    return pins if isinstance(pins, dict) else {}


def _refuse(where: str, found: str, expected: str) -> NoReturn:
    raise ConfigError(
        where=f"{PINS}: {where}",
        found=found,
        expected=expected,
        action="Restore the fixture, or review the change and run `genpolicy fixtures --pin`.",
    )
