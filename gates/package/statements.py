"""What a gate said of a candidate, as an in-toto statement: who it is about, and on what it rests.

Subjects are the candidate's checkpoint (the dataset at Gate A, where no candidate exists yet) and
the report; the predicate names everything that the report names by hash, and who overrides what.
Form: in-toto Statement v1 (`_type`, `subject`, `predicateType`, `predicate`). It is not signed:
whoever has the bundle derives it again, and people sign the trial card.
"""

from typing import Any

from gates.report import Gate, GateReport, report_path

STATEMENT_TYPE = "https://in-toto.io/Statement/v1"
PREDICATE_TYPE = "urn:genpolicy:gate-verdict:2"
DATASET = "artifacts/ingest/manifest.json"


def statement_of(
    report: GateReport, *, digest: str, candidate: str, checkpoint: str, dataset: str
) -> dict[str, Any]:
    """The statement of one gate.

    Args:
        report: Of the gate, proved.
        digest: SHA-256 of the report as it lies there.
        candidate: Name of the candidate.
        checkpoint: SHA-256 that identifies its weights.
        dataset: SHA-256 of the dataset's manifest.
    """
    about = (
        _subject(DATASET, dataset)
        if report.gate == "A"
        else _subject(f"checkpoint of {candidate}", checkpoint)
    )
    return {
        "_type": STATEMENT_TYPE,
        "subject": [about, _subject(report_path(report.gate), digest)],
        "predicateType": PREDICATE_TYPE,
        "predicate": {
            "gate": report.gate,
            "verdict": report.verdict,
            "of_candidate": report.candidates.get(candidate),
            "promoted": report.promoted == candidate,
            "upstream": report.upstream,
            "materials": report.materials,
            "code": report.code,
            "parameters": report.parameters,
            "pipeline": report.pipeline,
            "environment": report.environment,
            "caveats": list(report.caveats),
            "overrides": [entry.model_dump(mode="json") for entry in report.overrides],
        },
    }


def statement_path(gate: Gate) -> str:
    """Where the statement of a gate lies in a bundle."""
    return f"statements/gate_{gate.lower()}.json"


def _subject(name: str, sha256: str) -> dict[str, Any]:
    return {"name": name, "digest": {"sha256": sha256}}
