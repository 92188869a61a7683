"""What stands behind a distilled checkpoint, counted again: which teacher, and what both took.

Training writes it into the student's configuration. Gates B and D print it as the cost of an answer
in few steps, so it is held against the teacher that lies there and the settings of both trainings;
nothing of `genpolicy.policies` is asked.
"""

from collections.abc import Iterable
from pathlib import Path
from typing import Any

from gates.report import Gate
from gates.stated import compare_keys, mapping, refuse
from genpolicy.evidence.documents.stress import DISTILLED
from genpolicy.integrity.documents import read_json
from genpolicy.integrity.hashing import sha256_bytes, sha256_file
from genpolicy.integrity.tables import read_table

GENERATORS = "artifacts/train_generators"
STRESS = "artifacts/stress"
EVALUATIONS = 3
"""Of a window in an update of the student: the student's, its slow copy's and the teacher's."""
GRADIENTS = 1
"""Those among them that are differentiated: the student's."""
HOW = "as the teacher and both trainings say"


def rederive_costs(root: Path, seeds: Iterable[Path]) -> None:
    """Hold what each distilled checkpoint says of its teacher against the teacher.

    Args:
        root: The workspace.
        seeds: Folders of checkpoints, of any methods.

    Raises:
        RefusedError: The teacher is another one, or what both took is counted differently.
        IntegrityError: The teacher's files are missing.
        BadInputError: A configuration cannot be read.
    """
    for seed in seeds:
        stated = mapping(read_json(seed / "config.json")).get("distilled")
        if stated is not None:
            _compare(root, "B", seed, mapping(stated))


def rederive_distilled(root: Path, seed: object, *, folder: str = STRESS) -> None:
    """`distilled.json`: what the configuration of every compared candidate with a teacher says.

    Args:
        root: The workspace.
        seed: Number of the training seed that was compared.
        folder: Where the document and the rollouts lie.

    Raises:
        RefusedError: It says something else, or is not there.
        BadInputError: A document cannot be read.
    """
    compared = sorted(set(read_table(root / folder / "rollouts.parquet")["method"].to_pylist()))
    expected = {}
    for method in compared:
        path = root / GENERATORS / method / f"seed_{seed}" / "config.json"
        own = mapping(read_json(path)).get("distilled") if path.is_file() else None
        if own is not None:
            expected[method] = own
    path = root / folder / DISTILLED.file
    stated = mapping(read_json(path)) if path.is_file() else {}
    place = f"{folder}/{DISTILLED.file}"
    compare_keys("D", place, stated, expected, "as the candidate's configuration says")


def _compare(root: Path, gate: Gate, seed: Path, stated: dict[str, Any]) -> None:
    place = f"{seed.relative_to(root).as_posix()}/config.json: distilled"
    teacher = seed.parents[1] / str(stated.get("teacher")) / seed.name
    if not (teacher / "config.json").is_file():
        refuse(gate, f"{place}.teacher", str(stated.get("teacher")), "a candidate that lies there")
    own, before = (_batches(folder) for folder in (seed, teacher))
    derived = {
        "teacher": stated.get("teacher"),
        "teacher_sha256": identity(teacher),
        "updates": own[0] + before[0],
        "evaluations": EVALUATIONS * own[1] + before[1],
        "gradients": GRADIENTS * own[1] + before[1],
    }
    compare_keys(gate, place, stated, derived, HOW)


def _batches(folder: Path) -> tuple[int, int]:
    """Updates of a training, and windows in all of them."""
    training = mapping(mapping(read_json(folder / "config.json")).get("training"))
    updates, batch = int(training.get("updates", 0)), int(training.get("batch_size", 0))
    return updates, updates * batch


def identity(folder: Path) -> str:
    """Digest of weights and configuration, by which a checkpoint is known."""
    parts = (sha256_file(folder / name) for name in ("model.safetensors", "config.json"))
    return sha256_bytes("".join(f"{part}\n" for part in parts).encode())
