"""What Gate D says of candidates that were stopped: how far each ran, and why no further."""

from gates.engine import Judged
from gates.evidence import MissingEvidenceError
from gates.stress.rollouts import StressSettings
from gates.stress.stopped import ran


def stopped_said(judged: Judged) -> list[str]:
    """A caveat for each candidate that was stopped; one more where nobody was left to run beside.

    It is silent where all starts are one block, or rollouts are missing: the criteria say which.
    """
    settings = judged.settings
    assert isinstance(settings, StressSettings)
    try:
        found = ran(judged.evidence, settings)
        names = [] if found is None else [n for n in judged.candidates if n in found.seen]
        stops = [] if found is None else [found.stop_of(name) for name in names]
    except MissingEvidenceError:
        return []
    said = [f"{stop}." for stop in stops if stop is not None]
    if found is not None and found.last < settings.planned_starts:
        said.append(
            f"No candidate was left after {found.last} of {settings.planned_starts} starts, so "
            "that the simple methods ran no further either."
        )
    return said
