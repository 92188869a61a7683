"""The judges of gates A to D and the sections of `params.yaml`; Gate E joins them in `ladder`."""

import functools
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from gates import gate_a, gate_b, gate_c, gate_d
from gates.cause import CauseLimits, limits_of
from gates.engine import GateSpec, check_thresholds
from gates.models import Gate, GateReport, StrictModel, Threshold, parse_section, stage_of
from genpolicy.errors import ConfigError, IntegrityError
from genpolicy.integrity.documents import parse_yaml
from genpolicy.integrity.hashing import sha256_bytes_of

PARAMS_FILE = "params.yaml"


@dataclass(frozen=True)
class Judge:
    """A gate's specification, settings model and judge."""

    spec: GateSpec
    params: type[StrictModel]
    judge: Callable[..., GateReport]


LOWER: dict[Gate, Judge] = {
    "A": Judge(gate_a.SPEC, gate_a.Params, gate_a.judge),
    "B": Judge(gate_b.SPEC, gate_b.Params, gate_b.judge),
    "C": Judge(gate_c.SPEC, gate_c.Params, gate_c.judge),
    "D": Judge(gate_d.SPEC, gate_d.Params, gate_d.judge),
}


def read_section(
    root: Path, spec: GateSpec, model: type[StrictModel]
) -> tuple[dict[str, Threshold], StrictModel]:
    """Thresholds and other settings of a gate from `params.yaml`.

    Raises:
        ConfigError: The file or the section is missing or breaks its model.
    """
    name = stage_of(spec.gate)
    where = f"{PARAMS_FILE}: {name}"
    section = plain_section(root, name)
    rest: dict[str, Any] = {key: value for key, value in section.items() if key != "thresholds"}
    raw = section.get("thresholds")
    if raw is not None and not isinstance(raw, dict):
        raise ConfigError(
            where=f"{where}.thresholds",
            found=type(raw).__name__,
            expected="a mapping from criterion to limit, reason and owner",
            action="Correct the section.",
        )
    thresholds = {
        str(key): parse_section(Threshold, value, where=f"{where}.thresholds.{key}")
        for key, value in (raw or {}).items()
    }
    check_thresholds(spec, thresholds)
    return thresholds, parse_section(model, rest, where=where)


def read_cause_limits(path: Path) -> CauseLimits:
    """Limits of the cause from the `gate_a` section of a `params.yaml`.

    Raises:
        ConfigError: The file, the section or a limit is missing or wrong.
    """
    where = f"{path}: gate_a"
    try:
        document = parse_yaml(sha256_bytes_of(path, keep=True)[1], where=str(path))
    except IntegrityError as error:
        raise ConfigError(
            where=str(path),
            found=error.found,
            expected=error.expected,
            action="Name a file of settings.",
        ) from error
    section = document.get("gate_a") if isinstance(document, dict) else None
    if not isinstance(section, dict) or not isinstance(section.get("thresholds"), dict):
        raise ConfigError(
            where=where,
            found="missing",
            expected="a section with `cause` and `thresholds`",
            action="Name a file of settings of the ladder.",
        )
    thresholds = {
        str(key): parse_section(Threshold, value, where=f"{where}.thresholds.{key}")
        for key, value in section["thresholds"].items()
    }
    return limits_of(section.get("cause"), thresholds, where=f"{where}.cause")


def plain_section(root: Path, name: str) -> dict[str, Any]:
    """One section of `params.yaml`, not yet checked against a model.

    Raises:
        ConfigError: The file or the section is missing.
    """
    try:
        data = sha256_bytes_of(root / PARAMS_FILE, keep=True)[1]
    except IntegrityError as error:
        raise ConfigError(
            where=PARAMS_FILE,
            found=error.found,
            expected=error.expected,
            action="Restore the settings file.",
        ) from error
    document = _parsed(data)
    section = document.get(name) if isinstance(document, dict) else None
    if not isinstance(section, dict):
        raise ConfigError(
            where=f"{PARAMS_FILE}: {name}",
            found="missing",
            expected="a section of settings",
            action="Add the section.",
        )
    return section


@functools.lru_cache(maxsize=4)
def _parsed(data: bytes) -> Any:
    return parse_yaml(data, where=PARAMS_FILE)


def judge_with(root: Path, judge: Judge) -> GateReport:
    """Report of a gate from the evidence and `params.yaml` below `root`; writes nothing.

    Raises:
        ConfigError: The section is missing or wrong.
        IntegrityError: Evidence that is not what it claims to be.
    """
    thresholds, params = read_section(root, judge.spec, judge.params)
    return judge.judge(root, thresholds, params)


def judge_lower(root: Path, gate: Gate) -> GateReport:
    """`judge_with` of one of the gates A to D."""
    return judge_with(root, LOWER[gate])
