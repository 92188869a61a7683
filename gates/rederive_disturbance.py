"""Gate D's pushes, drills and people drawn again: every rollout met what its condition plans."""

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from gates.rederive_shadow import TaskSection
from gates.stated import refuse, root_seed, section
from genpolicy.evidence.stress.settings import StressSettings
from genpolicy.tasks.api import load_task
from genpolicy.verification.attended import PlannedPerson, attended_otherwise
from genpolicy.verification.disturbed import Plan, disturbed_otherwise
from genpolicy.verification.journal_source import readable


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
        perturbations={name: entry.model_dump() for name, entry in stress.perturbations.items()},
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
