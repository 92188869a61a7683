"""Writing reports: judge, print page, summary and rows, and put the JSON there last.

The old JSON is removed first, so that a crash in between leaves no verdict rather than an old
one. `python -m gates.writing` prints the ladder's first page once more.
"""

import contextlib
from pathlib import Path

from gates.overriders import require_written
from gates.pages.rows import rows_folder
from gates.pipeline import LOCK, stages_of
from gates.proof import judge
from gates.report import GATES, Gate, GateReport, read_report, report_bytes, report_path, stage_of
from genpolicy.errors import BadInputError
from genpolicy.integrity.atomic import output_folder, write_bytes

INDEX = "reports/index.html"
"""The ladder's first page, which a reader opens first."""


def write_gate(root: Path, gate: Gate) -> GateReport:
    """Judge a gate and write its report: rows, Markdown, HTML, then JSON.

    A FAIL is a result like any other and raises nothing. What is refused before anything is judged
    leaves the report that is there; a judgement that began and cannot end leaves none, since one
    of before would be nobody's.

    Raises:
        ConfigError: The section of `params.yaml` is missing or wrong, or a limit is overridden by
            somebody who may not, or no longer.
        BadInputError: Evidence that is not what it claims to be, or an unwritable place.
    """
    base = root / report_path(gate)
    require_written(root)
    _remove(base)
    write_index(root)
    report = judge(root, gate)
    from gates.pages.printing import printed_beside  # noqa: PLC0415  (loads matplotlib)

    printed = printed_beside(root, report)
    with output_folder(root / rows_folder(gate)) as folder:
        for name in [name for name in printed if name.startswith(f"{rows_folder(gate)}/")]:
            write_bytes(folder / Path(name).name, printed.pop(name))
    for name, data in printed.items():
        write_bytes(root / name, data)
    write_bytes(base, report_bytes(report))
    write_index(root)
    return report


def write_index(root: Path) -> Path:
    """Write the ladder's first page from the reports that lie there."""
    path = root / INDEX
    write_bytes(path, _index_page(root))
    return path


def changed_page(root: Path) -> str:
    """The first printed page or file of rows that is another one than the reports give.

    Empty if none is. The first page has no record, since every gate prints it again, and neither
    have those of a gate whose entry was taken out of `dvc.lock`: these are printed once more and
    compared. All others are held against the recorded run where the report is proved, and printed
    again too where evidence is derived again (`gates.rederive`): a record may have been made anew.

    Raises:
        GenpolicyError: A report or its evidence cannot be read.
    """
    from gates.pages.printing import differing  # noqa: PLC0415  (loads matplotlib)

    path = root / INDEX
    if path.is_file() and path.read_bytes() != _index_page(root) and _built(root):
        return INDEX
    for gate in GATES:
        base = root / report_path(gate)
        if not base.is_file():
            continue
        run = stages_of(root, LOCK).get(stage_of(gate)) or {}
        recorded = frozenset(str(entry.get("path")) for entry in run.get("outs") or ())
        report, _ = read_report(root, gate)
        if not all((root / report_path(below)).is_file() for below in report.upstream):
            continue  # its page shows what those below say; that one lacks is told by the proof
        if name := differing(root, report, recorded=recorded, whole=False):
            return name
    return ""


def _index_page(root: Path) -> bytes:
    from gates.pages.page import index_page  # noqa: PLC0415  (loads matplotlib)

    return index_page(root).encode()


def _built(root: Path) -> bool:
    """Whether all evidence of the reports lies there; without it the first page shows less.

    Whatever lacks is told where the reports are proved.
    """
    return all(
        (root / material).is_file()
        for gate in GATES
        if (root / report_path(gate)).is_file()
        for material in read_report(root, gate)[0].materials
    )


def _remove(path: Path) -> None:
    try:
        with contextlib.suppress(FileNotFoundError):
            path.unlink()
    except OSError as error:
        raise BadInputError(
            where=str(path),
            found=f"not removable ({error.strerror})",
            expected="a writable reports folder",
            action="Fix the permissions, then judge again.",
        ) from error


if __name__ == "__main__":
    write_index(Path())
