"""Stage `wall_clock`: the same recorded windows by the wall clock and by the virtual one.

Times of this machine: like the stage `latency`, no two runs give the same bytes, and nothing else
runs beside it.
"""

from pathlib import Path

from gates.proof import admit
from genpolicy.candidates.brought import BroughtSection, read_brought
from genpolicy.candidates.contenders import admitted_contenders
from genpolicy.data.dataset import load_dataset
from genpolicy.evidence.reproducibility.latency import latency_models
from genpolicy.evidence.rows.reproducibility import LatencyRow
from genpolicy.evidence.stress.latency import LatencySection
from genpolicy.evidence.stress.settings import StressSettings
from genpolicy.execution.cell import Cell, ExecutionSettings
from genpolicy.feasibility.settings import FeasibilitySettings
from genpolicy.integrity.atomic import output_folder
from genpolicy.integrity.rows import read_columns
from genpolicy.policies.matched_training import PolicySettings
from genpolicy.tasks.fixtures import PINS
from genpolicy.wall_clock.bench import WallClockSection, bench, limits_of
from genpolicy.wall_clock.clocks import write_clocks
from stages._contracts import require_one_contract
from stages._stage import ARTIFACTS, Params, main


def work(params: Params) -> None:
    """Admit through gate C, then replay the windows of every candidate by both clocks."""
    admitted = admit("wall_clock", Path.cwd()).candidates
    require_one_contract("train_generators")
    timing = params.section("latency", LatencySection)
    table = read_columns(ARTIFACTS / "latency" / "latency.parquet", LatencyRow).to_pandas()
    seed = params.section("policy", PolicySettings).seeds[0]
    device = params.compute.device
    brought = read_brought(params.section("candidates", BroughtSection).root, seed=seed)
    with (
        output_folder(ARTIFACTS / "wall_clock") as folder,
        bench(
            load_dataset(ARTIFACTS / "ingest"),
            limits_of(
                params.task.name,
                Cell(params.horizons, params.section("execution", ExecutionSettings)),
                params.section("feasibility", FeasibilitySettings),
            ),
            section=params.section("wall_clock", WallClockSection),
            samples=params.section("stress", StressSettings).samples,
            root_seed=params.seed,
            pins=Path(PINS),
        ) as shared,
    ):
        write_clocks(
            folder,
            shared,
            admitted_contenders(ARTIFACTS, admitted, brought, seed=seed, device=device),
            latency_models(table, timing.declared_terms),
        )


if __name__ == "__main__":
    main("wall_clock", work)
