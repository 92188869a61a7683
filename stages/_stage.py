"""What every stage does around its work: parse its section, admit, time itself, exit properly.

A stage is `python -m stages.<name>`, run in the root of a workspace (by DVC). It reads its own
section of `params.yaml` and the shared ones, refuses unknown keys, and writes its folder whole
or not at all.
"""

import contextlib
import json
import os
import resource
import sys
import time
import traceback
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any, NoReturn, TypeVar

from pydantic import BaseModel, Field

from genpolicy.contract.horizons import HorizonConfig
from genpolicy.contract.settings import Settings, parse_settings
from genpolicy.errors import DEAD_WORKER, ConfigError, GenpolicyError
from genpolicy.integrity.documents import read_yaml
from genpolicy.progress import LOG_EVERY_S, STAGE, still_at_it

Model = TypeVar("Model", bound=BaseModel)

PARAMS = Path("params.yaml")
ARTIFACTS = Path("artifacts")
TIMES = Path("build/times")
SILENT = ("latency", "wall_clock")
"""Stages that measure time: nothing else runs in their process meanwhile."""
KILLED = (
    "a process that worked for this stage was killed: by the machine, for memory, or by somebody. "
    "Nothing is half-written; run it again, with fewer `compute.workers` if memory was short."
)
OURS = "this is a fault of genpolicy, not of your input. Report the lines above."
TRAINS, RARELY_S = "train_", 60.0
"""Stages whose processes say how far they are; how often the stage itself speaks beside them."""

STAGES = (
    "task", "record", "ingest", "audit", "train_baselines", "measure_baselines", "train_factors",
    "measure_factors", "gate_a", "candidates", "train_generators", "reload", "latency", "gate_b",
    "shadow", "gate_c", "wall_clock", "stress", "monitors", "gate_d", "card", "gate_e",
)  # fmt: skip
SHARED = (
    "seed", "confidence", "task", "source", "horizons", "compute", "policy", "comparison",
    "feasibility", "execution", "rehearsal",
)  # fmt: skip


class TaskSection(Settings):
    """Which task the ladder runs on."""

    name: str


class ComputeSection(Settings):
    """Where the work runs.

    Attributes:
        workers: Processes that shards are spread over.
        scheduler: `local` for a Dask cluster on this machine, or the address of a scheduler.
        device: Torch device of training, and of inference wherever a policy of ours is asked.
    """

    workers: int = Field(ge=1, le=256)
    scheduler: str
    device: str


@dataclass(frozen=True)
class Params:
    """`params.yaml`, read once: shared sections parsed, the others kept for their stages."""

    seed: int
    task: TaskSection
    horizons: HorizonConfig
    compute: ComputeSection
    raw: dict[str, Any]

    def section(self, name: str, model: type[Model]) -> Model:
        """The section `name`, parsed by its model.

        Raises:
            ConfigError: Missing section, unknown key, or a value that breaks its rule.
        """
        return _section(self.raw.get(name), model, where=f"{PARAMS}: {name}")


def load_params() -> Params:
    """Read `params.yaml` of the current workspace.

    Raises:
        ConfigError: Missing file, unknown section, or a shared section that breaks its rules.
    """
    raw = read_yaml(PARAMS)
    if not isinstance(raw, dict):
        raise ConfigError(
            where=str(PARAMS),
            found=f"a {type(raw).__name__}",
            expected="a mapping of sections",
            action="Restore the file from version control.",
        )
    for key in raw:
        if key not in (*STAGES, *SHARED):
            raise ConfigError(
                where=f"{PARAMS}: {key}",
                found="an unknown section",
                expected=f"one of {', '.join((*SHARED, *STAGES))}",
                action="Correct the spelling or remove it.",
            )
    if not isinstance(raw.get("seed"), int) or isinstance(raw.get("seed"), bool):
        raise ConfigError(
            where=f"{PARAMS}: seed",
            found=repr(raw.get("seed")),
            expected="a whole number",
            action="Give one root seed; every random stream is named below it.",
        )
    return Params(
        seed=raw["seed"],
        task=_section(raw.get("task"), TaskSection, where=f"{PARAMS}: task"),
        horizons=_section(raw.get("horizons"), HorizonConfig, where=f"{PARAMS}: horizons"),
        compute=_section(raw.get("compute"), ComputeSection, where=f"{PARAMS}: compute"),
        raw=raw,
    )


def main(name: str, work: Callable[[Params], None]) -> NoReturn:
    """Run the body of stage `name` and leave with the exit code that its end deserves.

    Args:
        name: Name of the stage, of its section and of its folder.
        work: Admits, measures or judges, and writes the outputs.
    """
    started = time.perf_counter()
    usual_s = _taken(name)
    with contextlib.suppress(OSError):
        (TIMES / f"{name}.json").unlink(missing_ok=True)
    os.environ[STAGE] = f"[{STAGES.index(name) + 1}/{len(STAGES)}] {name}"
    every_s = RARELY_S if name.startswith(TRAINS) else LOG_EVERY_S
    said = contextlib.nullcontext() if name in SILENT else still_at_it(usual_s, every_s=every_s)
    try:
        with said:
            work(load_params())
    except GenpolicyError as error:
        print(f"{name}: {error}", file=sys.stderr)
        _record(name, started, error.exit_code)
        sys.exit(error.exit_code)
    except Exception as error:
        traceback.print_exc()
        print(f"{name}: {unexpected(error)}", file=sys.stderr)
        _record(name, started, 1)
        sys.exit(1)
    _record(name, started, 0)
    sys.exit(0)


def unexpected(error: Exception) -> str:
    """What a stage says behind the traceback of an error that nobody raised on purpose."""
    return KILLED if type(error).__name__ in DEAD_WORKER else OURS


def _taken(name: str) -> float | None:
    """Wall time of the last run that was done, s; None where none is known."""
    try:
        last = json.loads((TIMES / f"{name}.json").read_text())
        return float(last["seconds"]) if last["exit_code"] == 0 else None
    except (OSError, ValueError, KeyError, TypeError):
        return None


def _record(name: str, started: float, code: int) -> None:
    """Wall time and peak memory of a stage, outside of everything that is hashed."""
    own = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    children = resource.getrusage(resource.RUSAGE_CHILDREN).ru_maxrss
    values: Mapping[str, Any] = {
        "stage": name,
        "seconds": round(time.perf_counter() - started, 2),
        "peak_mib": round(max(own, children) / 1024),
        "exit_code": code,
    }
    try:
        TIMES.mkdir(parents=True, exist_ok=True)
        (TIMES / f"{name}.json").write_text(json.dumps(values) + os.linesep)
    except OSError as error:
        print(f"{name}: time not recorded ({error.strerror})", file=sys.stderr)


def _section(value: Any, model: type[Model], *, where: str) -> Model:
    if not isinstance(value, dict):
        raise ConfigError(
            where=where,
            found="missing" if value is None else repr(value)[:80],
            expected="a section of keys and values",
            action="Restore it from version control.",
        )
    return parse_settings(model, value, where=where)
