"""`genpolicy fixtures`: show the fixtures of the ladder's task, or pin them."""

from pathlib import Path

from genpolicy.errors import ConfigError
from genpolicy.integrity.documents import read_yaml
from genpolicy.tasks.fixtures import fixture_hashes, pin, require_pinned
from genpolicy.tasks.identity import task_identity
from genpolicy.wall_clock.limits import pin_limits, require_limits


def run_fixtures(root: Path, *, task: str | None, write: bool) -> int:
    """Print the hashes; pin them, or hold them against the pins; limits of a wall clock too.

    Args:
        root: Workspace.
        task: Name of the task; that of `params.yaml` if None.
        write: Whether to pin.

    Raises:
        ConfigError: Not pinned so, or no task is named.
    """
    name = task or _task_of(root)
    found = pin(root, name) if write else fixture_hashes(task_identity(name))
    limits = pin_limits(root) if write else {}
    for key, value in {**found, **limits}.items():
        print(f"{key:<12}{value}")
    if not write:
        require_pinned(root, name, found)
        require_limits(root)
    return 0


def _task_of(root: Path) -> str:
    params = read_yaml(root / "params.yaml")
    section = params.get("task") if isinstance(params, dict) else None
    name = section.get("name") if isinstance(section, dict) else None
    if not isinstance(name, str):
        raise ConfigError(
            where="params.yaml: task.name",
            found=repr(name),
            expected="the name of a task",
            action="Name one there, or with --task.",
        )
    return name
