"""Stage `latency`: how long each term of an invocation takes on this machine.

Measured times live here and nowhere else, so that everything else is byte-reproducible.
"""

from pathlib import Path

import pyarrow as pa

from gates.admission import admit
from genpolicy.evidence.reproducibility.latency import LATENCY, LatencyJob, latency_rows
from genpolicy.feasibility.settings import FeasibilitySettings
from genpolicy.integrity.atomic import output_folder
from genpolicy.integrity.tables import write_table
from genpolicy.policies.matched_training import PolicySettings
from genpolicy.policies.policy import load_policy
from genpolicy.seeds import stream
from stages._stage import ARTIFACTS, Params, main
from stages._study import StudySection
from stages._timing import LatencySection


def work(params: Params) -> None:
    """Measure every method twice, each time in a fresh process."""
    admit("latency", Path.cwd())
    section = params.section("latency", LatencySection)
    seed = params.section("policy", PolicySettings).seeds[0]
    generators = params.section("generators", StudySection).samplers
    roots = {name: ARTIFACTS / "baselines" for name in section.baselines}
    roots |= {name: ARTIFACTS / "generators" for name in generators}
    jobs = {}
    for method, root in roots.items():
        checkpoint = root / method / f"seed_{seed}"
        jobs[method] = LatencyJob(
            checkpoint=checkpoint,
            sha256=load_policy(checkpoint).checkpoint_hash,
            dataset=ARTIFACTS / "ingest",
            task=params.task.name,
            feasibility=params.section("feasibility", FeasibilitySettings),
            horizons=params.horizons,
            warm=section.warm,
            cold=section.cold,
        )
    with output_folder(ARTIFACTS / "latency") as folder:
        rows = latency_rows(
            jobs,
            section.declared,
            declared_draws=section.declared_draws,
            generator=stream(params.seed, "latency", "declared"),
        )
        write_table(folder / "latency.parquet", pa.Table.from_pylist(rows, LATENCY))


if __name__ == "__main__":
    main("latency", work)
