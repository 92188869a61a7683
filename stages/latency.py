"""Stage `latency`: how long each term of an invocation takes on this machine.

Measured times live here and nowhere else, so that everything else is byte-reproducible.
"""

from pathlib import Path

from gates.proof import admit
from genpolicy.candidates.judged import compared
from genpolicy.evidence.reproducibility.latency import LatencyPlan, declared_rows, measured_rows
from genpolicy.evidence.rows.reproducibility import LatencyRow
from genpolicy.evidence.stress.settings import StressSettings
from genpolicy.feasibility.settings import FeasibilitySettings
from genpolicy.integrity.atomic import output_folder
from genpolicy.integrity.rows import write_rows
from genpolicy.policies.matched_training import PolicySettings
from genpolicy.seeds import stream
from stages._contracts import require_one_contract
from stages._latency import LatencySection
from stages._stage import ARTIFACTS, Params, main
from stages._training import MethodsSection


def work(params: Params) -> None:
    """Measure every method twice, each time in a fresh process."""
    admit("latency", Path.cwd())
    require_one_contract("train_baselines", "train_generators")
    section = params.section("latency", LatencySection)
    policies = compared(
        ARTIFACTS,
        baselines=params.section("stress", StressSettings).baselines,
        generators=params.section("train_generators", MethodsSection).samplers,
        seed=params.section("policy", PolicySettings).seeds[0],
    )
    plan = LatencyPlan(
        dataset=ARTIFACTS / "ingest",
        task=params.task.name,
        feasibility=params.section("feasibility", FeasibilitySettings),
        horizons=params.horizons,
        warm=section.warm,
        cold=section.cold,
    )
    with output_folder(ARTIFACTS / "latency") as folder:
        declared = declared_rows(
            [policy.name for policy in policies],
            section.declared_terms,
            draws=section.declared_draws,
            generator=stream(params.seed, "latency", "declared"),
        )
        rows = measured_rows(plan, policies) + declared
        write_rows(folder / "latency.parquet", LatencyRow, rows)


if __name__ == "__main__":
    main("latency", work)
