"""What every gate stage does: judge, write the report, and leave the verdict for its successors.

`artifacts/gate_x/verdict.json` changes only when the verdict or the evidence changes. The next
stage depends on it and not on the report, so that a limit moved within the same verdict
re-judges and re-trains nothing; admission still re-derives the verdict from the report.
"""

from pathlib import Path

from gates.report import Answer, Gate
from gates.writing import write_gate
from genpolicy.integrity.atomic import output_folder, write_bytes
from genpolicy.integrity.documents import canonical_json
from stages._stage import ARTIFACTS, Params


def judge(letter: Gate, params: Params) -> None:
    """Judge one gate; the verdict is an artifact like any other, whatever it says."""
    del params  # parsed already: unknown sections and keys are refused before anything is judged
    name = f"gate_{letter.lower()}"
    with output_folder(ARTIFACTS / name) as folder:
        report = write_gate(Path.cwd(), letter)
        token = {
            "gate": letter,
            "verdict": str(report.verdict),
            "candidates": {method: str(v) for method, v in report.candidates.items()},
            "materials": dict(report.materials),
        }
        write_bytes(folder / "verdict.json", canonical_json(token))
        measured = {_name(item): item.measured for item in report.criteria}
        write_bytes(folder / "metrics.json", canonical_json(measured))
        lines = ["criterion,measured,threshold,verdict"]
        lines += [
            f"{_name(item)},{_plain(item.measured)},{_plain(item.threshold)},{item.verdict}"
            for item in report.criteria
        ]
        write_bytes(folder / "criteria.csv", "\n".join([*lines, ""]).encode())
    print(f"gate {letter}: {report.verdict}; see reports/{name}.html")


def _name(criterion: Answer) -> str:
    return f"{criterion.candidate}.{criterion.id}" if criterion.candidate else criterion.id


def _plain(value: float | None) -> str:
    return "" if value is None else f"{value:.10g}"
