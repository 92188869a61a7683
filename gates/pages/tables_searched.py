"""Table of Gate E: what a search for failures found behind Gate D, and how hard it looked."""

from gates.card.searched import COUNTED, FAILURE_SEARCH, SEARCHED, Found, searched, size_of
from gates.evidence import Evidence, MissingEvidenceError
from gates.pages.bound import require_bound
from gates.pages.figures import Listing, Table
from gates.report import GateReport
from genpolicy.evidence.rows.failures import FAILURES, failure_name

HEADS = (
    "condition", "candidate", "rollouts, all planned beforehand", "failed",
    "smallest size at which it failed", "that failure", "where it starts",
)  # fmt: skip
NONE = "none was found"
UNSIZED = "has no size"


def _line(found: Found) -> tuple[str, ...]:
    row = found.mildest
    return (
        found.condition,
        found.method,
        f"{found.evaluated}",
        f"{found.failed}",
        (size_of(found) or UNSIZED) if row else NONE,
        f"{row.outcome}, {FAILURES}/{failure_name(row)}" if row else NONE,
        row.scene_start if row else NONE,
    )


def _listed(evidence: Evidence, report: GateReport) -> Table:
    require_bound(evidence, report, SEARCHED)
    found = searched(evidence.root)
    if not found:
        raise MissingEvidenceError("nobody looked: card.failure_search.evaluations is 0")
    return (HEADS, *map(_line, found))


FOUND = Listing(
    "Failures that a search found",
    f"Failures {COUNTED}. An optimiser chose starts and sizes, within what is planned, because "
    "they might fail: the share that failed is no rate of failure, and a condition without one is "
    "a condition in which so many rollouts found none. Each failure has a file below "
    f"{FAILURE_SEARCH}, from which it is run again.",
    SEARCHED,
    _listed,
    optional=True,
)
