"""What the pipeline recorded of the evidence under a gate, held against what lies here now.

`dvc.yaml` says what a stage reads and `dvc.lock` what it read and wrote when it ran. A gate judges
only evidence that its stage wrote, from the code and parameters that stand here now, and the
report names all three by hash. The gate's own entries are written after it has judged, so only
those of the evidence stages below it are bound.
"""

import fnmatch
import functools
import hashlib
import importlib.util
import json
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from pathlib import Path, PurePosixPath
from typing import Any

from gates.recorded import require_form
from gates.report import GATES, Gate, folder_of, report_path, stage_of
from genpolicy.documents.task import IDENTITY
from genpolicy.errors import ConfigError, IntegrityError
from genpolicy.integrity.documents import canonical_json, parse_json, parse_yaml
from genpolicy.integrity.hashing import sha256_bytes, sha256_bytes_of, sha256_file

PIPELINE, LOCK, IGNORED, PARAMS = "dvc.yaml", "dvc.lock", ".dvcignore", "params.yaml"
TASK = "artifacts/task"
TASK_IDENTITY = f"{TASK}/{IDENTITY.file}"
"""What the task is, by hash: material of every gate."""
CODE = ("genpolicy", "gates", "stages")
RUNGS: dict[Gate, tuple[str, ...]] = {
    "A": (
        "task", "record", "ingest", "audit", "train_baselines", "measure_baselines",
        "train_factors", "measure_factors",
    ),
    "B": ("candidates", "train_generators", "reload", "latency"),
    "C": ("shadow",),
    "D": ("wall_clock", "stress", "monitors"),
    "E": ("failure_search", "card"),
}  # fmt: skip
"""Evidence stages between a gate and the one below it."""
COMPILED = (".pyc", ".pyo")


@dataclass(frozen=True)
class Basis:
    """What a report stands on, beside the evidence itself.

    Attributes:
        code: SHA-256 per package, over the files that the gate and its evidence stages depend on.
        parameters: SHA-256 of each entry of `params.yaml` that its evidence stages read.
        pipeline: SHA-256 of the recorded run of each evidence stage.
        unrecorded: Evidence stages that no recorded run stands for.
    """

    code: Mapping[str, str] = field(default_factory=dict)
    parameters: Mapping[str, str] = field(default_factory=dict)
    pipeline: Mapping[str, str] = field(default_factory=dict)
    unrecorded: tuple[str, ...] = ()


def basis_of(root: Path, gate: Gate) -> Basis:
    """What stands under a gate here and now; not yet whether the evidence comes from it.

    Raises:
        ConfigError: `dvc.yaml`, `dvc.lock` or `params.yaml` is malformed.
        IntegrityError: A file of the code is missing or a link.
    """
    stages, recorded = stages_of(root, PIPELINE), stages_of(root, LOCK)
    names = (*RUNGS[gate], stage_of(gate))
    files: dict[str, dict[str, str]] = {}
    keys: set[str] = set()
    for name in names:
        stage = stages.get(name) or {}
        if name in RUNGS[gate]:  # the gate's own are re-derived, with a better sentence
            keys |= set(names_in(stage.get("params")))
        for dep in names_in(stage.get("deps")):
            if PurePosixPath(dep).parts[0] not in CODE:
                continue
            for file in files_at(root, dep):
                files.setdefault(PurePosixPath(file).parent.as_posix(), {})[file] = ""
    code = {
        package: sha256_bytes(canonical_json({name: sha256_file(root / name) for name in members}))
        for package, members in sorted(files.items())
    }
    params = _document(root / PARAMS, PARAMS)
    parameters = {key: sha256_bytes(canonical_json(_at(params, key))) for key in sorted(keys)}
    runs = {name: recorded[name] for name in RUNGS[gate] if name in recorded and name in stages}
    return Basis(
        code=code,
        parameters=parameters,
        pipeline={name: sha256_bytes(canonical_json(run)) for name, run in runs.items()},
        unrecorded=tuple(name for name in RUNGS[gate] if name not in runs),
    )


def check_record(root: Path, gate: Gate, materials: Mapping[str, str]) -> None:
    """Refuse evidence that its stage did not write, or wrote from other code or parameters.

    Args:
        root: Repository root.
        gate: The gate whose evidence stages are looked at; those without a record are left out.
        materials: SHA-256 of what was judged; the bytes compared here must be the same.

    Raises:
        IntegrityError: A file, a parameter, or what the stage reads is not as recorded.
        ConfigError: `dvc.yaml`, `dvc.lock` or `params.yaml` is malformed.
    """
    stages, recorded = stages_of(root, PIPELINE), stages_of(root, LOCK)
    params = _document(root / PARAMS, PARAMS)
    disk = Disk(root, materials)
    for name in RUNGS[gate]:
        if name not in recorded or name not in stages:
            continue
        run, stage = recorded[name], stages[name]
        _same_names(name, "deps", run.get("deps"), stage.get("deps"))
        _same_names(name, "outs", run.get("outs"), stage.get("outs"))
        for entry in (*(run.get("outs") or ()), *(run.get("deps") or ())):
            disk.check(name, entry)
        _same_parameters(name, (run.get("params") or {}).get(PARAMS) or {}, stage, params)
    changed = changed_task(root) if gate == "A" else ""
    if changed:
        raise IntegrityError(
            where=changed,
            found="other than the one measured on",
            expected=f"the file that {TASK_IDENTITY} names",
            action="Run `dvc repro`: everything is measured on the task.",
        )


def changed_pages(root: Path, gate: Gate) -> str:
    """Printed page of a gate that is not the one recorded when the gate ran; empty if none.

    A gate that was judged outside the pipeline has no record of its pages.
    """
    run = stages_of(root, LOCK).get(stage_of(gate)) or {}
    json_report = report_path(gate)
    disk = Disk(root, {})
    for entry in run.get("outs") or ():
        path = str(entry.get("path"))
        if not path.startswith("reports/") or path == json_report:
            continue
        if disk.md5(path) != entry.get("md5"):
            return path
    return ""


def outputs_of(root: Path, gate: Gate) -> tuple[str, ...]:
    """Every file below the folders of a gate's evidence stages, by path, sorted."""
    folders = [folder_of(stage) for stage in RUNGS[gate]]
    lying = [folder for folder in folders if (root / folder).is_dir()]
    return tuple(sorted({name for folder in lying for name in files_at(root, folder)}))


class Disk:
    """Files as DVC sees them: MD5 of a file, or of the list of those of a folder."""

    def __init__(self, root: Path, materials: Mapping[str, str]) -> None:
        self._root, self._materials = root, materials
        self._known: dict[str, str] = {}

    def check(self, stage: str, entry: Any) -> None:
        """Refuse what is not as a recorded run read or wrote it."""
        path, expected = str(entry.get("path")), entry.get("md5")
        found = self.md5(path)
        if found and found == expected:
            return
        wrote = path.startswith(folder_of(stage))
        raise IntegrityError(
            where=path,
            found="missing" if not found else f"other than recorded (md5 {found[:12]}…)",
            expected=f"what `{stage}` {'wrote' if wrote else 'ran with'} by {LOCK}",
            action=f"Run `dvc repro {stage}`, or restore the original bytes.",
        )

    def md5(self, path: str) -> str:
        """MD5 of a file or folder; empty where nothing lies."""
        if path not in self._known:
            target = self._root / path
            if target.is_dir():
                listed = [
                    {"md5": self._file(name), "relpath": str(PurePosixPath(name).relative_to(path))}
                    for name in files_at(self._root, path)
                ]
                listed.sort(key=lambda item: item["relpath"])
                text = json.dumps(listed, sort_keys=True).encode()
                self._known[path] = f"{_md5(text)}.dir"
            else:
                self._known[path] = self._file(path) if target.is_file() else ""
        return self._known[path]

    def _file(self, name: str) -> str:
        digest, data = sha256_bytes_of(self._root / name, keep=True)
        if self._materials.get(name, digest) != digest:
            raise IntegrityError(
                where=name,
                found="changed while it was judged",
                expected="the bytes that were judged",
                action="Judge again, with nothing else writing here.",
            )
        return _md5(data)


def _md5(data: bytes) -> str:
    return hashlib.md5(data, usedforsecurity=False).hexdigest()


def files_at(root: Path, path: str) -> Iterator[str]:
    """Files at or below a path, without those that DVC ignores; nothing where nothing lies."""
    target = root / path
    if not target.is_dir():
        if target.is_file() or target.is_symlink():
            yield path
        return
    ignored = _ignored(root)
    for file in sorted(target.rglob("*")):
        name = file.relative_to(root)
        if file.is_dir() and not file.is_symlink():
            continue
        if not any(fnmatch.fnmatch(part, glob) for part in name.parts for glob in ignored):
            yield name.as_posix()


def _ignored(root: Path) -> tuple[str, ...]:
    file = root / IGNORED
    lines = file.read_text().splitlines() if file.is_file() else []
    return tuple(line.strip() for line in lines if line.strip() and not line.startswith("#"))


def _same_names(stage: str, kind: str, recorded: Any, listed: Any) -> None:
    found = {str(entry.get("path")) for entry in recorded or ()}
    expected = set(names_in(listed))
    if found != expected:
        raise IntegrityError(
            where=f"{LOCK}: {stage}.{kind}",
            found=f"without or beyond {', '.join(sorted(found ^ expected))}",
            expected=f"what {PIPELINE} lists",
            action=f"Run `dvc repro {stage}`.",
        )


def _same_parameters(
    stage: str, recorded: Mapping[str, Any], listed: Mapping[str, Any], params: Any
) -> None:
    for key in sorted({*recorded, *names_in(listed.get("params"))}):
        now = _at(params, key)
        if key not in recorded or not _equal(recorded[key], now):
            raise IntegrityError(
                where=f"{PARAMS}: {key}",
                found="other than recorded",
                expected=f"the value that `{stage}` ran with by {LOCK}",
                action=f"Run `dvc repro {stage}`, or restore the value.",
            )


def _equal(recorded: Any, now: Any) -> bool:
    """Equality of values; the two YAML writers spell small numbers differently (1e-05)."""
    if isinstance(recorded, dict) and isinstance(now, dict):
        return set(recorded) == set(now) and all(_equal(recorded[k], now[k]) for k in now)
    if isinstance(recorded, list) and isinstance(now, list):
        same = len(recorded) == len(now)
        return same and all(_equal(a, b) for a, b in zip(recorded, now, strict=True))
    if isinstance(recorded, str) and isinstance(now, float):
        try:
            return float(recorded) == now
        except ValueError:
            return False
    return bool(recorded == now) and isinstance(recorded, bool) == isinstance(now, bool)


def changed_task(root: Path) -> str:
    """File of the task's package that is not the one measured on, wherever it is installed."""
    file = root / TASK_IDENTITY
    if not file.is_file():
        return ""
    stated = parse_json(sha256_bytes_of(file, keep=True)[1], where=TASK_IDENTITY)
    identity = IDENTITY.parse(stated, where=TASK_IDENTITY)
    package, found = identity.package, _package(root, identity.entry_point)
    other = [name for name in {*package, *found} if package.get(name) != found.get(name)]
    return f"the task {identity.name}: {min(other)}" if other else ""


def _package(root: Path, entry_point: str) -> dict[str, str]:
    """SHA-256 of the files around an entry point's module, by path inside its package."""
    module = entry_point.partition(":")[0]
    own = root / f"{module.replace('.', '/')}.py"
    if own.is_file():
        origin = own
    else:
        spec = importlib.util.find_spec(module) if module else None
        if spec is None or spec.origin is None:
            return {}
        origin = Path(spec.origin).resolve()
        if "." not in module and spec.submodule_search_locations is None:
            return {origin.name: sha256_file(origin)}
    return {
        path.relative_to(origin.parent).as_posix(): sha256_file(path)
        for path in sorted(origin.parent.rglob("*"))
        if path.is_file() and path.suffix not in COMPILED and "__pycache__" not in path.parts
    }


def _at(params: Any, key: str) -> Any:
    for part in key.split("."):
        params = params.get(part) if isinstance(params, dict) else None
    return params


def names_in(entries: Any) -> list[str]:
    """Paths or keys of a list of `dvc.yaml`: texts, or mappings with one key."""
    return [
        name
        for entry in entries or ()
        for name in ([entry] if isinstance(entry, str) else [str(key) for key in entry])
    ]


def stages_of(root: Path, name: str) -> dict[str, Any]:
    """Entries of `dvc.yaml` or `dvc.lock` by stage; none where the file is missing.

    Raises:
        ConfigError: The file is malformed.
    """
    document = _document(root / name, name)
    stages = document.get("stages") if isinstance(document, dict) else None
    if stages is not None and not isinstance(stages, dict):
        raise ConfigError(
            where=f"{name}: stages",
            found=f"a {type(stages).__name__}",
            expected="a mapping",
            action="Restore the file from version control.",
        )
    require_form(name, stages or {})
    return {key: value for key, value in (stages or {}).items() if isinstance(value, dict)}


def _document(path: Path, name: str) -> Any:
    if not path.is_file():
        return {}
    return _parsed(sha256_bytes_of(path, keep=True)[1], name)


@functools.lru_cache(maxsize=6)
def _parsed(data: bytes, name: str) -> Any:
    return parse_yaml(data, where=name)


assert tuple(RUNGS) == GATES
