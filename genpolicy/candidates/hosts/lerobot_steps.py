"""What a LeRobot folder has its processors do: named steps of arithmetic, and no other code.

LeRobot imports whatever a step names under `class` and calls it with the settings beside it:
`{"class": "os.system", "config": {"command": ...}}` runs. Some of its own steps fetch a tokenizer,
and code with it, from elsewhere, and a step keeps its numbers in any file that it names. So the two
documents of processors are read before LeRobot reads them, and only steps are let through that
compute with numbers of pinned files.
"""

from collections.abc import Mapping
from pathlib import Path
from typing import Any, NoReturn

from genpolicy.candidates.hosts.kinds import LeRobotEntry
from genpolicy.errors import ConfigError
from genpolicy.integrity.documents import read_json

PROCESSORS = ("policy_preprocessor.json", "policy_postprocessor.json")
STEPS = (
    "rename_observations_processor", "to_batch_processor", "device_processor",
    "normalizer_processor", "unnormalizer_processor",
)  # fmt: skip
"""All that LeRobot 0.6.1 gives ACT and Diffusion; none runs code, fetches or remembers anything."""


def require_steps(entry: LeRobotEntry, folder: Path) -> None:
    """Refuse processors that are not steps of arithmetic with numbers of pinned files.

    A document that is not there is not asked for: LeRobot refuses such a folder when it is served.

    Args:
        entry: What it is.
        folder: Of the entry's file.

    Raises:
        BadInputError: A document that is no JSON.
        ConfigError: A step that is not known to compute only, or a file that `files` does not name.
    """
    for document in PROCESSORS:
        path = folder / entry.pretrained_model / document
        if not path.is_file():
            continue
        found = read_json(path)
        steps = found.get("steps") if isinstance(found, dict) else None
        if not isinstance(steps, list):
            _refuse(path, "without a list of steps", "a document of processors")
        for number, step in enumerate(steps):
            _require_step(step, f"{path}: steps[{number}]")
            _require_pinned(step, entry, f"{path}: steps[{number}].state_file")


def _require_step(step: Any, where: str) -> None:
    said = step if isinstance(step, dict) else {}
    name = said.get("registry_name")
    if "class" in said or name not in STEPS:
        _refuse(
            where,
            f"the class {said['class']!r}"[:80] if "class" in said else f"the step {name!r}"[:80],
            f"steps that run no code of others and fetch nothing ({', '.join(STEPS)})",
        )


def _require_pinned(step: Mapping[str, Any], entry: LeRobotEntry, where: str) -> None:
    if "state_file" not in step:
        return
    name = step["state_file"]
    pinned = isinstance(name, str) and (Path(entry.pretrained_model) / name).as_posix()
    if pinned not in entry.files or Path(name).name != name:
        _refuse(where, repr(name)[:80], "a file of the folder that `files` names by its hash")


def _refuse(where: Path | str, found: str, expected: str) -> NoReturn:
    raise ConfigError(
        where=str(where),
        found=found,
        expected=expected,
        action="Save the policy with LeRobot's `save_pretrained`, or serve it by a command of your "
        "own (kind server).",
    )
