"""Stage `latency`: how long each term of an invocation takes on this machine.

Measured times live here and nowhere else, so that everything else is byte-reproducible.
"""

from pathlib import Path

from gates.proof import admit
from genpolicy.candidates.brought import BroughtSection, read_brought
from genpolicy.candidates.contenders import in_comparison
from genpolicy.evidence.reproducibility.latency import (
    PROCESSES,
    LatencyPlan,
    declared_rows,
    measure_all,
    model_rows,
)
from genpolicy.evidence.reproducibility.load import candidates_rows
from genpolicy.evidence.reproducibility.sweep import sweep_latency_rows
from genpolicy.evidence.reproducibility.swept import SweepSection
from genpolicy.evidence.rows.reproducibility import (
    CandidatesRow,
    LatencyModelRow,
    LatencyRow,
    MachineRow,
    SweepLatencyRow,
)
from genpolicy.evidence.stress.latency import LatencySection
from genpolicy.evidence.stress.settings import StressSettings
from genpolicy.feasibility.settings import FeasibilitySettings
from genpolicy.integrity.atomic import output_folder
from genpolicy.integrity.rows import write_rows
from genpolicy.policies.matched_training import PolicySettings
from genpolicy.seeds import stream
from stages._contracts import require_one_contract
from stages._stage import ARTIFACTS, Params, main
from stages._training import MethodsSection


def work(params: Params) -> None:
    """Measure every method twice, each time in several fresh processes."""
    admit("latency", Path.cwd())
    require_one_contract("train_baselines", "train_generators")
    section = params.section("latency", LatencySection)
    stress = params.section("stress", StressSettings)
    generators = params.section("train_generators", MethodsSection).samplers
    sweep = params.section("reload", SweepSection).sweep
    seed = params.section("policy", PolicySettings).seeds[0]
    brought = read_brought(params.section("candidates", BroughtSection).root, seed=seed)
    policies = in_comparison(
        ARTIFACTS,
        baselines=stress.baselines,
        candidates=[*generators, *(policy.name for policy in brought)],
        brought=brought,
        seed=seed,
        device=params.compute.device,
        task=params.task.name,
        horizons=params.horizons,
    )
    plan = LatencyPlan(
        dataset=ARTIFACTS / "ingest",
        task=params.task.name,
        feasibility=params.section("feasibility", FeasibilitySettings),
        horizons=params.horizons,
        samples=stress.samples,
        warm=section.warm,
        cold=section.cold,
        joining=stress.joining,
    )
    with output_folder(ARTIFACTS / "latency") as folder:
        declared = declared_rows(
            [policy.name for policy in policies],
            section.declared_terms,
            draws=section.warm * len(PROCESSES),
            generator=stream(params.seed, "latency", "declared"),
        )
        taken = measure_all(plan, policies)
        model = model_rows(taken.rows, section.declared_terms, root_seed=params.seed)
        write_rows(folder / "latency.parquet", LatencyRow, taken.rows + declared)
        write_rows(folder / "machine.parquet", MachineRow, taken.machine)
        write_rows(folder / "model.parquet", LatencyModelRow, model)
        write_rows(folder / "candidates.parquet", CandidatesRow, candidates_rows(plan, policies))
        write_rows(
            folder / "sweep.parquet",
            SweepLatencyRow,
            sweep_latency_rows(
                plan,
                [policy for policy in policies if policy.name not in stress.baselines],
                sweep,
            ),
        )


if __name__ == "__main__":
    main("latency", work)
