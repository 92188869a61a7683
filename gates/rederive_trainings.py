"""Further trainings of the comparison: which there must be, and whose a refusal is."""

from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path
from typing import Any

from gates.settings import section_of
from gates.stated import compare_keys, mapping, refuse
from gates.stress.rollouts import STRESS
from genpolicy.errors import RefusedError
from genpolicy.evidence.documents.stress import TRAININGS, Trainings, folder_of_seed
from genpolicy.integrity.documents import read_json


def seed_folders(root: Path, params: Mapping[str, Any]) -> dict[int, str]:
    """Folder of each further training seed that is planned, from the root, by its number.

    Args:
        root: Root of the workspace.
        params: `params.yaml`.

    Raises:
        RefusedError: Another seed lies there, one lacks, or the stage says that it ran others.
        BadInputError: What the stage says cannot be read.
    """
    seeds = section_of(params, "policy").get("seeds")
    planned = [int(seed) for seed in seeds[1:]] if isinstance(seeds, list) else []
    path = root / STRESS / TRAININGS.file
    expected = TRAININGS.plain(Trainings(seeds=planned)) if planned else {}
    stated = mapping(read_json(path)) if path.is_file() else {}
    compare_keys("D", f"{STRESS}/{TRAININGS.file}", stated, expected, "as planned")
    folders = {seed: f"{STRESS}/{folder_of_seed(seed)}" for seed in planned}
    above = (root / STRESS / folder_of_seed(0)).parent
    lying = sorted(above.iterdir()) if above.is_dir() else []
    found = [path.relative_to(root).as_posix() for path in lying]
    if set(found) != set(folders.values()):
        told = ", ".join(found) or "nothing"
        refuse("D", f"{STRESS}: further trainings", told, "one folder of each of policy.seeds")
    return folders


def only_seed(params: Mapping[str, Any], seed: int) -> dict[str, Any]:
    """The plan as that of one training seed."""
    return {**params, "policy": {**section_of(params, "policy"), "seeds": [seed]}}


@contextmanager
def of_training(seed: int) -> Iterator[None]:
    """Say of which training a refusal is: its tables and journals have the names of the first.

    Raises:
        RefusedError: As it was raised inside, with the seed in front.
    """
    try:
        yield
    except RefusedError as error:
        raise RefusedError(
            gate=error.gate,
            criterion=f"training seed {seed}: {error.criterion}",
            measured=error.measured,
            limit=error.limit,
            report=error.report,
            action=error.action,
        ) from error
