"""Stage `generators`: diffusion and flow on the network and budget of the baselines."""

from pathlib import Path

from gates.proof import admit
from genpolicy.evidence.need.study import run_study
from genpolicy.integrity.atomic import output_folder
from genpolicy.policies.matched_training import PolicySettings
from stages._stage import ARTIFACTS, Params, main
from stages._study import StudySection, study_of


def work(params: Params) -> None:
    """Admit through gate A, then train and measure every candidate."""
    admit("generators", Path.cwd())
    section = params.section("generators", StudySection)
    first_seed = params.section("policy", PolicySettings).seeds[0]
    with output_folder(ARTIFACTS / "generators") as folder:
        run_study(
            study_of(params, section),
            dataset=ARTIFACTS / "ingest",
            audit=ARTIFACTS / "audit",
            folder=folder,
            reference=ARTIFACTS / "baselines" / "chunked_bc" / f"seed_{first_seed}",
        )


if __name__ == "__main__":
    main("generators", work)
