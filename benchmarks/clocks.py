"""Do the two clocks agree where nothing is injected? The rule of Gate D, of a ladder below it.

A ladder that is stopped at Gate A has trained baselines and recordings and no stage `wall_clock`.
Here one of its policies is timed as Gate B times, replayed on windows of held-out episodes by the
wall clock and by the virtual one, and compared by the rule and the tolerances of Gate D, all as
`params.yaml` has them. Nothing is judged by it; a busy machine is late.

    python -m benchmarks.clocks --method act
    python -m benchmarks.clocks --workspace DIR --method chunked_bc --episodes 48
"""

import argparse
import sys
from collections.abc import Sequence
from pathlib import Path
from tempfile import TemporaryDirectory

import pandas as pd

from gates.evidence import Evidence
from gates.proof import SPECS
from gates.settings import read_limits, read_params, read_settings
from gates.stress.clocks import AGREE, compared
from gates.stress.rollouts import StressSettings
from genpolicy.candidates.judged import BASELINES, trained
from genpolicy.contract.horizons import HorizonConfig
from genpolicy.contract.settings import parse_settings
from genpolicy.data.dataset import load_dataset
from genpolicy.evidence.reproducibility.latency import LatencyPlan, latency_models, measure_all
from genpolicy.evidence.stress.latency import LatencySection
from genpolicy.execution.cell import Cell, ExecutionSettings
from genpolicy.feasibility.settings import FeasibilitySettings
from genpolicy.tasks.fixtures import PINS
from genpolicy.wall_clock.bench import WallClockSection, bench, limits_of
from genpolicy.wall_clock.clocks import write_clocks


def arguments(argv: Sequence[str] | None = None) -> argparse.Namespace:
    """The command line."""
    parser = argparse.ArgumentParser(prog="python -m benchmarks.clocks", description=__doc__)
    parser.add_argument("--workspace", type=Path, default=Path(), help="a ladder that trained")
    parser.add_argument("--method", default="act", help="one of its baselines")
    parser.add_argument("--episodes", type=int, default=48)
    return parser.parse_args(argv)


def main(argv: Sequence[str] | None = None) -> int:
    """Time, replay, compare, print. 0 where the clocks agree, and nowhere else."""
    args = arguments(argv)
    root = args.workspace
    params = read_params(root)
    task, seed = params["task"]["name"], params["seed"]
    stress = params["stress"]
    horizons = parse_settings(HorizonConfig, params["horizons"], where="horizons")
    feasibility = parse_settings(FeasibilitySettings, params["feasibility"], where="feasibility")
    execution = parse_settings(ExecutionSettings, params["execution"], where="execution")
    timing = parse_settings(LatencySection, params["latency"], where="latency")
    spec = SPECS["D"]
    settings = read_settings(params, "gate_d", StressSettings)
    settings = settings.under(read_limits(params, "D", spec.criteria))
    (policy,) = trained(
        root / "artifacts" / BASELINES,
        [args.method],
        seeds=params["policy"]["seeds"][:1],
        device=params["compute"]["device"],
    )
    dataset = root / "artifacts" / "ingest"
    plan = LatencyPlan(
        dataset=dataset, task=task, feasibility=feasibility, horizons=horizons,
        samples=stress["samples"], warm=timing.warm, cold=timing.cold,
    )  # fmt: skip
    rows = pd.DataFrame([vars(row) for row in measure_all(plan, [policy]).rows])
    with TemporaryDirectory() as scratch:
        folder = Path(scratch) / "artifacts" / "wall_clock"
        folder.mkdir(parents=True)
        with bench(
            load_dataset(dataset),
            limits_of(task, Cell(horizons, execution), feasibility),
            section=WallClockSection(episodes=args.episodes),
            samples=stress["samples"], root_seed=seed, pins=root / PINS,
        ) as shared:  # fmt: skip
            write_clocks(folder, shared, [policy], latency_models(rows, timing.declared_terms))
        found = compared(Evidence(Path(scratch)), settings, args.method)
    print(f"{args.method}: the clocks {found.answer}; {found.episodes} episodes; {found.why}")
    return int(found.answer != AGREE)


if __name__ == "__main__":
    sys.exit(main())
