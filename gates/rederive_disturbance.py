"""Gate D's pushes, drills and people drawn again: every rollout met what its condition plans."""

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from gates.rederive_shadow import TaskSection
from gates.stated import refuse, root_seed, section
from gates.stress.rollouts import STRESS
from genpolicy.evidence.rows.stress import SEVERITIES
from genpolicy.evidence.stress.settings import StressSettings
from genpolicy.integrity.tables import read_table
from genpolicy.tasks.api import load_task
from genpolicy.verification.attended import PlannedPerson, attended_otherwise
from genpolicy.verification.disturbed import Plan, disturbed_otherwise
from genpolicy.verification.journal_source import readable


def rederive_severities(root: Path, params: Mapping[str, Any]) -> None:
    """Hold `severities.parquet` against the plan: every size that is shown was to be run.

    Raises:
        RefusedError: It says another size, another condition, or is there without a plan.
        ConfigError: The section of `params.yaml` cannot be read.
        IntegrityError: It is no whole table.
    """
    path = root / STRESS / SEVERITIES
    planned = [vars(row) for row in section(params, "stress", StressSettings).severity_rows]
    stated = read_table(path).to_pylist() if path.is_file() else []
    if stated != planned:
        told = f"{len(stated)} sizes of conditions, {len(planned)} by the plan, or other ones"
        refuse("D", f"{STRESS}/{SEVERITIES}", told, "what params.yaml plans")


def rederive_disturbance(params: Mapping[str, Any], journals: Sequence[Path]) -> None:
    """Hold every push, drill and person of the comparison against the plan.

    Raises:
        RefusedError: One is missing, or is another than planned.
        ConfigError: A section of `params.yaml` cannot be read.
        IntegrityError: A journal is missing or no regular file.
        BadInputError: A journal cannot be read.
    """
    stress = section(params, "stress", StressSettings)
    task = load_task(section(params, "task", TaskSection).name)
    plan = Plan(
        perturbations={name: entry.model_dump() for name, entry in stress.conditions.items()},
        contact_phases=frozenset(task.contact_phases),
        root_seed=root_seed(params),
    )
    person, seed = None, root_seed(params)
    if stress.person is not None:
        person = PlannedPerson(stress.person.reaction_s, stress.person.longest_s, seed)
    for path in journals:
        with readable(f"{path.parent.name}/{path.name}"):
            found = next(disturbed_otherwise(path, plan), None) or next(
                attended_otherwise(path, person), None
            )
        if found is not None:
            refuse("D", path.name, found, "what params.yaml plans for its condition")
