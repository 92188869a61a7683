"""A separate workspace of the ladder, with some values of `params.yaml` replaced.

The smoke ladder, experiments and the ladder's own tests run `dvc repro` in such a folder, so that
nothing in the code asks whether it runs "small", and the outputs of the checkout stay as they
are. Making it again brings only differences over: what did not change stays up to date for DVC.
"""

import configparser
import io
import json
import subprocess
import sys
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import yaml

from genpolicy.cli.shell import run_program
from genpolicy.errors import BadInputError, ConfigError
from genpolicy.integrity.atomic import write_bytes
from genpolicy.integrity.documents import read_json, read_yaml

PARAMS = "params.yaml"
PIPELINE = "dvc.yaml"
LOCK = "dvc.lock"
DVC_CONFIG = ".dvc/config"
COPIED = ".workspace.json"
LIMITS, WAIVED, ANSWERED = "limits", "not_applicable", "waived_checks"
"""Keys of a gate's section: its limits; criteria, and questions of the audit, that owners waive."""


def make_workspace(source: Path, target: Path, overrides: Mapping[str, Any] | Path) -> Path:
    """Bring `target` to the state of the checkout `source`, with `overrides` in its parameters.

    Copied is what git tracks or would track, in its present state, without what the stages write
    (the outputs in `dvc.yaml`) and without `dvc.lock`: outputs and lock of the target are its own.

    Args:
        source: A git checkout with `dvc.yaml` and `params.yaml`.
        target: Folder to make or to refresh; inside the source only where git ignores it.
        overrides: Nested values for `params.yaml`, or a YAML file with them.

    Returns:
        `target`.

    Raises:
        ConfigError: An override names a key that `params.yaml` does not have, or a file is missing.
        BadInputError: The source is no git checkout, or the target holds something else.
    """
    source, target = source.resolve(), target.resolve()
    if isinstance(overrides, Path):
        overrides = _mapping(overrides)
    parameters = merged(_mapping(source / PARAMS), overrides)
    before = _copied_before(target)
    files = _files_to_copy(source, target)
    for name in sorted(set(before) - set(files)):
        (target / name).unlink(missing_ok=True)
    for name in files:
        _copy(source / name, target / name)
    text = yaml.safe_dump(parameters, sort_keys=False, allow_unicode=True)
    _write_if_other(target / PARAMS, text.encode())
    _write_if_other(target / DVC_CONFIG, _config_without_scm(source / DVC_CONFIG))
    (target / ".dvc" / "tmp").mkdir(exist_ok=True)
    _write_if_other(target / COPIED, json.dumps(files, indent=1).encode())
    return target


def merged(
    base: Mapping[str, Any], overrides: Mapping[str, Any], *, at: str = ""
) -> dict[str, Any]:
    """`base` with the leaves of `overrides` in place of its own; every key must exist in `base`.

    Only what owners of a gate waive by name may be added. A criterion that is declared not
    applicable takes its limit away: a limit and a waiver of one criterion exclude each other.

    Raises:
        ConfigError: An unknown key, or a section replaced by a value or the other way round.
    """
    result = dict(base)
    for key, value in overrides.items():
        place = f"{at}.{key}" if at else str(key)
        if key in (WAIVED, ANSWERED) and isinstance(base.get(LIMITS), Mapping):
            result[key] = value
            continue
        if not base:  # a section that stands empty has its defaults in code, which know its keys
            result[key] = value
            continue
        if key not in base:
            raise ConfigError(
                where=f"override {place}",
                found="not a key of params.yaml",
                expected=f"one of {', '.join(map(str, base))}",
                action="Correct the spelling; an override never adds a key.",
            )
        if isinstance(base[key], Mapping) != isinstance(value, Mapping):
            raise ConfigError(
                where=f"override {place}",
                found=f"a {type(value).__name__}",
                expected=f"a {type(base[key]).__name__}, as in params.yaml",
                action="Override the values inside a section, not the section.",
            )
        result[key] = merged(base[key], value, at=place) if isinstance(value, Mapping) else value
    if WAIVED in overrides and LIMITS in base:
        waived = {name for names in overrides[WAIVED].values() for name in names}
        result[LIMITS] = {
            owner: {name: limit for name, limit in limits.items() if name not in waived}
            for owner, limits in result[LIMITS].items()
        }
    return result


def declared_outputs(pipeline: Mapping[str, Any]) -> tuple[str, ...]:
    """Every path that a stage of `dvc.yaml` writes."""
    names: list[str] = []
    for stage in (pipeline.get("stages") or {}).values():
        for kind in ("outs", "metrics", "plots"):
            for entry in stage.get(kind) or ():
                names += [entry] if isinstance(entry, str) else list(entry)
    return tuple(names)


def _mapping(path: Path) -> dict[str, Any]:
    value = read_yaml(path)
    if value is None:
        return {}
    if not isinstance(value, dict):
        raise ConfigError(
            where=str(path),
            found=f"a {type(value).__name__}",
            expected="a mapping of sections",
            action="Correct the file.",
        )
    return value


def _copied_before(target: Path) -> list[str]:
    record = target / COPIED
    if record.is_file():
        names = read_json(record)
        return [name for name in names if _is_inside(target, name)]
    if target.is_dir() and any(target.iterdir()):
        raise BadInputError(
            where=str(target),
            found="a folder with something else in it",
            expected="a workspace made before, or no folder",
            action="Name another target, or remove the folder yourself.",
        )
    return []


def _files_to_copy(source: Path, target: Path) -> list[str]:
    """Tracked and untracked-but-not-ignored files, as POSIX paths relative to the source."""
    command = ["git", "-C", str(source), "ls-files", "-z", "-co", "--exclude-standard", "--", "."]
    try:
        listed = subprocess.run(command, capture_output=True, check=True)
    except (OSError, subprocess.CalledProcessError) as error:
        detail = getattr(error, "stderr", b"") or str(error).encode()
        raise BadInputError(
            where=str(source),
            found=f"not listable ({detail.decode(errors='replace').strip()})",
            expected="a git checkout",
            action="Run it in a clone of the repository.",
        ) from error
    outputs = declared_outputs(_mapping(source / PIPELINE))
    own = {PARAMS, LOCK, DVC_CONFIG, COPIED}
    return sorted(
        name
        for name in set(filter(None, listed.stdout.decode().split("\0")))
        if name not in own
        and not any(name == out or name.startswith(f"{out}/") for out in outputs)
        and (source / name).is_file()
        and not (source / name).is_symlink()
        and not (source / name).resolve().is_relative_to(target)
    )


def _copy(source: Path, target: Path) -> None:
    _write_if_other(target, source.read_bytes())
    mode = source.stat().st_mode & 0o777
    if target.stat().st_mode & 0o777 != mode:
        target.chmod(mode)


def _write_if_other(path: Path, data: bytes) -> None:
    if not (path.is_file() and path.read_bytes() == data):
        write_bytes(path, data)


def _config_without_scm(path: Path) -> bytes:
    """The DVC configuration of the source, told that no git lies around the workspace."""
    config = configparser.ConfigParser()
    if path.is_file():
        config.read_string(path.read_text())
    if not config.has_section("core"):
        config.add_section("core")
    config["core"]["no_scm"] = "True"
    stream = io.StringIO()
    config.write(stream)
    return stream.getvalue().encode()


def _is_inside(folder: Path, name: str) -> bool:
    return (folder / name).resolve().is_relative_to(folder.resolve())


if __name__ == "__main__":
    sys.exit(run_program("flows.commands:workspace", "python -m flows.workspace"))
