"""Stage `audit`: modes, their cause and their worth, measured on the dataset."""

from genpolicy.audit.evidence import write_evidence
from genpolicy.audit.settings import AuditSettings
from genpolicy.evidence.need.audit_task import audit_task, round_obstacles, settings_of
from genpolicy.evidence.need.pictures import scene_png
from genpolicy.feasibility.settings import FeasibilitySettings
from genpolicy.integrity.atomic import output_folder, write_bytes
from genpolicy.tasks.api import load_task
from stages._confidence import confidence_of
from stages._contracts import require_one_contract
from stages._stage import ARTIFACTS, Params, main


def work(params: Params) -> None:
    """Audit the dataset and write the evidence."""
    require_one_contract()
    task = load_task(params.task.name)
    own = params.section("audit", AuditSettings)
    settings = settings_of(own, task, params.horizons, confidence=confidence_of(params))
    feasibility = params.section("feasibility", FeasibilitySettings)
    with output_folder(ARTIFACTS / "audit") as folder:
        result = audit_task(
            ARTIFACTS / "ingest",
            task_name=params.task.name,
            settings=settings,
            feasibility=feasibility,
            action_period_s=params.horizons.action_period_s,
            root_seed=params.seed,
        )
        obstacles = round_obstacles(task)
        write_evidence(result, folder, settings=settings, obstacles=obstacles)
        write_bytes(folder / "scene.png", scene_png(params.task.name))


if __name__ == "__main__":
    main("audit", work)
