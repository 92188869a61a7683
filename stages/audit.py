"""Stage `audit`: modes, their cause and their worth, measured on the dataset."""

from genpolicy.audit.evidence import write_evidence
from genpolicy.audit.settings import AuditSettings
from genpolicy.comparison.audit_task import audit_task
from genpolicy.feasibility.settings import FeasibilitySettings
from genpolicy.integrity.atomic import output_folder
from genpolicy.simulation.rollout import ExecutionSettings
from stages._stage import ARTIFACTS, Params, main


def work(params: Params) -> None:
    """Audit the dataset and write the evidence."""
    settings = params.section("audit", AuditSettings)
    with output_folder(ARTIFACTS / "audit") as folder:
        result = audit_task(
            ARTIFACTS / "ingest",
            task_name=params.task.name,
            settings=settings,
            feasibility=params.section("feasibility", FeasibilitySettings),
            maximum_age_s=params.section("execution", ExecutionSettings).maximum_age_s,
            action_period_s=params.horizons.action_period_s,
            root_seed=params.seed,
        )
        write_evidence(result, folder)


if __name__ == "__main__":
    main("audit", work)
