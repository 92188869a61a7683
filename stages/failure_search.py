"""Stage `failure_search`: where do the candidates that Gate D lets through begin to fail?

`python -m stages.failure_search FILE` runs a failure that was found again, and says whether the
same happened: 0 the same to the last event, 3 something else.
"""

import sys
from collections.abc import Sequence
from pathlib import Path

from gates.proof import admit
from genpolicy.candidates.brought import BroughtSection, read_brought
from genpolicy.candidates.contenders import admitted_contenders
from genpolicy.errors import BadInputError, RefusedError
from genpolicy.evidence.documents.failures import FAILURE
from genpolicy.evidence.failure_search.conditions import searched_conditions
from genpolicy.evidence.failure_search.rollouts import Searching
from genpolicy.evidence.failure_search.settings import search_settings
from genpolicy.evidence.failure_search.tables import (
    JOURNALS,
    plan_searches,
    run_again,
    search_of,
    write_searches,
)
from genpolicy.evidence.reproducibility.latency import latency_models
from genpolicy.evidence.rows.reproducibility import LatencyRow
from genpolicy.evidence.stress.latency import LatencySection
from genpolicy.evidence.stress.settings import StressSettings
from genpolicy.evidence.stress.shard import Comparison
from genpolicy.execution.cell import Cell, ExecutionSettings
from genpolicy.feasibility.settings import FeasibilitySettings
from genpolicy.integrity.atomic import output_folder
from genpolicy.integrity.documents import read_json
from genpolicy.integrity.rows import read_columns
from genpolicy.policies.matched_training import PolicySettings
from stages._beside import main
from stages._contracts import require_one_contract
from stages._stage import ARTIFACTS, Params


def work(params: Params) -> None:
    """Admit through gate D, then search every condition for failures of whoever passed it."""
    admitted = admit("failure_search", Path.cwd()).candidates
    require_one_contract("train_generators", dataset=False)
    looks = search_settings(params.raw).evaluations > 0
    with output_folder(ARTIFACTS / "failure_search") as folder:
        write_searches(
            folder,
            planned(params, admitted, journals=folder / JOURNALS) if looks else [],
            workers=params.compute.workers,
            scheduler=params.compute.scheduler,
        )


def planned(params: Params, candidates: Sequence[str], *, journals: Path) -> list[Searching]:
    """Every search of these candidates, under what the comparison ran under."""
    evaluations = search_settings(params.raw).evaluations
    section = params.section("stress", StressSettings)
    seed = params.section("policy", PolicySettings).seeds[0]
    brought = read_brought(params.section("candidates", BroughtSection).root, seed=seed)
    table = read_columns(ARTIFACTS / "latency" / "latency.parquet", LatencyRow).to_pandas()
    comparison = Comparison(
        task=params.task.name,
        starts=(),
        episode_limit_s=section.episode_limit_s,
        samples=section.samples,
        cell=Cell(params.horizons, params.section("execution", ExecutionSettings)),
        feasibility=params.section("feasibility", FeasibilitySettings),
        root_seed=params.seed,
        joining=section.joining,
        person=section.person,
    )
    return plan_searches(
        comparison,
        admitted_contenders(
            ARTIFACTS, candidates, brought, seed=seed, device=params.compute.device
        ),
        searched_conditions(section),
        evaluations=evaluations,
        latency=latency_models(table, params.section("latency", LatencySection).declared_terms),
        journals=journals,
    )


def again(params: Params, path: Path) -> None:
    """Run a failure that was found again.

    Raises:
        RefusedError: Something else happened.
        BadInputError: No file of a failure, or of another search than lies here.
    """
    failure = FAILURE.parse(read_json(path), where=str(path))
    require_one_contract("train_generators", dataset=False)
    searches = planned(params, [failure.method], journals=Path())
    try:
        now = run_again(search_of(searches, failure), failure)
    except ValueError as error:  # a size that the condition does not take
        raise BadInputError(
            where=str(path),
            found=f"{type(error).__name__}: {str(error).splitlines()[0]}",
            expected="a failure as the search wrote it",
            action="Take the file from artifacts/failure_search/failures.",
        ) from error
    then, found = FAILURE.plain(failure), FAILURE.plain(now)
    if other := next((name for name in then if then[name] != found[name]), ""):
        raise RefusedError(
            gate="E",
            criterion=f"{path.name}: {other}",
            measured=f"{found[other]} ({now.outcome})",
            limit=f"{then[other]} ({failure.outcome}), as found",
            report="artifacts/failure_search/searched.parquet",
            action="Is code, a library or the processor another one?",
        )
    print(f"{path.name}: the same again, {failure.outcome}")


if __name__ == "__main__":
    if len(sys.argv) > 1:
        main("failure_search", lambda params: again(params, Path(sys.argv[1])), writes=False)
    main("failure_search", work)
