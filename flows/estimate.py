"""How long a run of the whole ladder may take, said before its first stage.

Asked of the times that stages left behind here. What they do not say is said to be unknown: a
stage behind a gate that refused has not run, and other settings take other times.
"""

from pathlib import Path

from genpolicy.errors import GenpolicyError
from genpolicy.integrity.documents import read_json, read_yaml
from genpolicy.outputs import PIPELINE, TIMES
from genpolicy.progress import duration

DOCUMENTED = (
    "nothing has run here. On two cores the default ladder takes about an hour up to gate A, "
    "`make smoke` 7 to 17 min for all gates (docs/troubleshooting.md)"
)


def estimate(workspace: Path) -> str:
    """One line: how long the stages of `dvc.yaml` took here last time.

    Args:
        workspace: Folder with `dvc.yaml`; what cannot be read is left to DVC to refuse.
    """
    stages = _stages(workspace / PIPELINE)
    taken = [_taken_s(workspace / TIMES / f"{stage}.json") for stage in stages]
    known = [seconds for seconds in taken if seconds is not None]
    if not known:
        return f"Estimate: {DOCUMENTED}."
    others = len(stages) - len(known)
    of = f"{len(known)} of {len(stages)} stages" if others else f"all {len(stages)} stages"
    rest = f" The other {others} have no finished run here, and nobody knows." if others else ""
    total = duration(sum(known))
    return f"Estimate: {total} for {of}, as last time here; what is up to date is skipped.{rest}"


def _stages(pipeline: Path) -> list[str]:
    try:
        return list(read_yaml(pipeline)["stages"])
    except (GenpolicyError, KeyError, TypeError):
        return []


def _taken_s(path: Path) -> float | None:
    """Wall time of a last run that was done, s; None where none is known."""
    try:
        record = read_json(path)
        return float(record["seconds"]) if record["exit_code"] == 0 else None
    except (GenpolicyError, KeyError, TypeError, ValueError):
        return None
