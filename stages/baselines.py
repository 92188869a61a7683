"""Stage `baselines`: the simpler policies, trained and measured under one configuration."""

from genpolicy.evidence.need.study import run_study
from genpolicy.integrity.atomic import output_folder
from stages._stage import ARTIFACTS, Params, main
from stages._study import StudySection, study_of


def work(params: Params) -> None:
    """Train and measure every baseline."""
    section = params.section("baselines", StudySection)
    with output_folder(ARTIFACTS / "baselines") as folder:
        run_study(
            study_of(params, section),
            dataset=ARTIFACTS / "ingest",
            audit=ARTIFACTS / "audit",
            folder=folder,
        )


if __name__ == "__main__":
    main("baselines", work)
