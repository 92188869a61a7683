"""What a page shows of evidence is what its report was judged by, or it is not shown."""

from gates.evidence import Evidence, MissingEvidenceError
from gates.report import GateReport


def require_bound(evidence: Evidence, report: GateReport, path: str) -> None:
    """Require that a file lies there with the bytes that a report names.

    Args:
        evidence: The evidence.
        report: The report that was judged by it.
        path: The file, relative to the repository.

    Raises:
        MissingEvidenceError: It is missing, or has other bytes, or the report does not name it.
    """
    digest = evidence.digest(path)
    if not digest:
        raise MissingEvidenceError(f"{path} is missing: it is not built here")
    if report.materials.get(path) != digest:
        raise MissingEvidenceError(f"{path} is not the file that the report names")
