"""Identity of a task: everything that makes a measurement one of this task, by hash.

A task may be installed outside the tree, where no dependency of the pipeline sees an edit. So its
files, scene, contract and robot table are hashed into one document, which is evidence like any
other: stages depend on it and gates bind it.
"""

from importlib.metadata import EntryPoint
from importlib.util import find_spec
from pathlib import Path
from typing import Any

import numpy as np

from genpolicy.contract.action import action_contract_hash
from genpolicy.documents.task import IDENTITY, TaskIdentity
from genpolicy.errors import ConfigError
from genpolicy.integrity.documents import canonical_json
from genpolicy.integrity.hashing import sha256_bytes, sha256_file
from genpolicy.robot.limits import RobotLimits
from genpolicy.tasks.api import Task, find_task, load_task

COMPILED = (".pyc", ".pyo")


def task_identity(name: str) -> dict[str, Any]:
    """The identity of a registered task.

    Returns:
        A `TaskIdentity` fit for canonical JSON; `sha256` is over all the rest.

    Raises:
        ConfigError: No task of that name, or its phases or joints contradict each other.
    """
    point = find_task(name)
    files = package_files(point)  # before the code is loaded: an edit in between is seen next time
    task = load_task(name)
    _check(task)
    scene = task.scene_path.resolve()
    identity = TaskIdentity(
        name=name,
        entry_point=point.value,
        distribution=_distribution(point),
        package={key: sha256_file(path) for key, path in files.items()},
        scene=_scene_files(scene, inside=set(files.values())),
        scene_sha256=sha256_file(scene),
        observation_sha256=task.observation.hash(),
        action_sha256=action_contract_hash(),
        phases={
            "all": list(task.phases),
            "contact": sorted(task.contact_phases),
            "opening": sorted(task.opening_phases),
            "free": sorted(task.free_phases),
        },
        obstacles=list(task.obstacles),
        workspace_m=(task.workspace.lower_m, task.workspace.upper_m),
        robot=task.limits.robot,
        robot_sha256=limits_sha256(task.limits),
        sha256="",
    )
    body = IDENTITY.plain(identity)
    del body["sha256"]
    return {**body, "sha256": sha256_bytes(canonical_json(body))}


def package_files(point: EntryPoint) -> dict[str, Path]:
    """The files of the package around an entry point's module, by POSIX path inside it.

    A module in no package is its own file. What the package imports from elsewhere is not hashed;
    the distribution's version stands for it.

    Raises:
        ConfigError: The module is nowhere to be found.
    """
    spec = find_spec(point.module)
    if spec is None or spec.origin is None:
        raise ConfigError(
            where=f"the task {point.name}",
            found=f"registered as {point.value}, which cannot be imported",
            expected="an installed module",
            action="Install the task's distribution again.",
        )
    origin = Path(spec.origin).resolve()
    if "." not in point.module and spec.submodule_search_locations is None:
        return {origin.name: origin}
    folder = origin.parent
    return {
        path.relative_to(folder).as_posix(): path
        for path in sorted(folder.rglob("*"))
        if path.is_file() and path.suffix not in COMPILED and "__pycache__" not in path.parts
    }


def limits_sha256(limits: RobotLimits) -> str:
    """SHA-256 of a table of limits, its source included."""
    fields = {name: getattr(limits, name) for name in limits.__dataclass_fields__}
    plain = {k: v.tolist() if isinstance(v, np.ndarray) else v for k, v in fields.items()}
    return sha256_bytes(canonical_json(plain))


def _scene_files(scene: Path, *, inside: set[Path]) -> dict[str, str]:
    """Files beside a scene that lies outside the package: meshes and what it includes."""
    if scene in inside:
        return {}
    paths = sorted(path for path in scene.parent.rglob("*") if path.is_file())
    return {path.relative_to(scene.parent).as_posix(): sha256_file(path) for path in paths}


def _distribution(point: EntryPoint) -> dict[str, str]:
    found = point.dist
    return {"name": found.name, "version": found.version} if found else {"name": "", "version": ""}


def _check(task: Task) -> None:
    for name in ("contact_phases", "opening_phases", "free_phases"):
        unknown = sorted(getattr(task, name) - set(task.phases))
        if unknown:
            _refuse(task, name, str(unknown), f"phases out of {list(task.phases)}")
    joints, posture = len(task.limits.position_lower_rad), len(task.posture_rad)
    if joints != posture:
        _refuse(task, "limits", f"of {joints} joints", f"{posture}, as the task's posture has")


def _refuse(task: Task, member: str, found: str, expected: str) -> None:
    raise ConfigError(
        where=f"the task {task.name}: {member}",
        found=found,
        expected=expected,
        action="Correct the task's package.",
    )
