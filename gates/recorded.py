"""The form of what `dvc.yaml` and `dvc.lock` say of a stage, before anything is read from it."""

from collections.abc import Mapping
from typing import Any

from genpolicy.errors import ConfigError

LISTS = ("deps", "outs", "metrics", "plots")


def require_form(name: str, stages: Mapping[str, Any]) -> None:
    """Refuse entries of another form than DVC writes.

    Args:
        name: File that they are from: `dvc.lock` has mappings where `dvc.yaml` has texts too.
        stages: Its stages by name; one that is no mapping is nobody's stage.

    Raises:
        ConfigError: A list that is none, an entry of another type, or parameters of another form.
    """
    locked = name.endswith(".lock")
    kinds: tuple[type, ...] = (dict,) if locked else (str, dict)
    for stage, entry in stages.items():
        if not isinstance(entry, dict):
            continue
        params = entry.get("params")
        wrong = [
            part
            for part in (*LISTS, *(() if locked else ("params",)))
            if not _is_list_of(entry.get(part), kinds)
        ]
        if locked and not (params is None or _is_nested(params)):
            wrong.append("params")
        if wrong:
            raise ConfigError(
                where=f"{name}: {stage}.{wrong[0]}",
                found=f"{entry.get(wrong[0])!r:.60}",
                expected="what DVC writes there",
                action="Restore the file from version control.",
            )


def _is_list_of(value: Any, kinds: tuple[type, ...]) -> bool:
    return value is None or (
        isinstance(value, list) and all(isinstance(item, kinds) for item in value)
    )


def _is_nested(value: Any) -> bool:
    return isinstance(value, dict) and all(isinstance(inner, dict) for inner in value.values())
