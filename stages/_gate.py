"""What every gate stage does: judge, write the report, and leave the verdict for its successors.

`artifacts/gate_x/verdict.json` changes only when the verdict or the evidence changes. The next
stage depends on it and not on the report, so that a limit moved within the same verdict
re-judges and re-trains nothing; admission still re-derives the verdict from the report.
`reports/gate_x.metrics.json` is versioned beside the report, so that `dvc metrics diff` needs no
cache to say which verdict turned.
"""

from pathlib import Path

from gates.overriders import require_written
from gates.report import Answer, Gate, GateReport
from gates.writing import write_gate
from genpolicy.integrity.atomic import output_folder, write_bytes
from genpolicy.integrity.documents import canonical_json
from stages._stage import ARTIFACTS, Params


def judge(letter: Gate, params: Params) -> None:
    """Judge one gate; the verdict is an artifact like any other, whatever it says."""
    del params  # parsed already: unknown sections and keys are refused before anything is judged
    name = f"gate_{letter.lower()}"
    require_written(Path.cwd())  # before the folder of the verdict goes, as of the report
    with output_folder(ARTIFACTS / name) as folder:
        report = write_gate(Path.cwd(), letter)
        token = {
            "gate": letter,
            "verdict": str(report.verdict),
            "candidates": {method: str(v) for method, v in report.candidates.items()},
            "materials": dict(report.materials),
        }
        write_bytes(folder / "verdict.json", canonical_json(token))
        write_bytes(Path("reports") / f"{name}.metrics.json", canonical_json(_metrics(report)))
        lines = ["criterion,measured,threshold,verdict"]
        lines += [
            f"{_name(item)},{_plain(item.measured)},{_plain(item.threshold)},{item.verdict}"
            for item in report.criteria
        ]
        write_bytes(folder / "criteria.csv", "\n".join([*lines, ""]).encode())
    print(f"gate {letter}: {report.verdict}; see reports/{name}.html")


def _metrics(report: GateReport) -> dict[str, object]:
    """What `dvc metrics diff` compares: a verdict that turns shows, also where no number moved."""
    return {
        "verdict": str(report.verdict),
        "passes": int(report.verdict == "PASS"),
        "overridden": len(report.overrides),
        "candidates": {method: str(verdict) for method, verdict in report.candidates.items()},
        "criteria": {
            _name(item): {
                "measured": item.measured,
                "threshold": item.threshold,
                "verdict": str(item.verdict),
            }
            for item in report.criteria
        },
    }


def _name(criterion: Answer) -> str:
    return f"{criterion.candidate}.{criterion.id}" if criterion.candidate else criterion.id


def _plain(value: float | None) -> str:
    return "" if value is None else f"{value:.10g}"
