"""All that is printed beside a report: its page, its summary, and the rows under its numbers."""

from pathlib import Path

from gates.pages.page import gate_page
from gates.pages.rows import printed_rows, rows_folder, rows_of
from gates.pages.summary import markdown
from gates.report import GateReport, parse_report, report_bytes, report_path


def printed_beside(root: Path, report: GateReport) -> dict[str, bytes]:
    """Bytes of every printed file by its path from the root, the page and the summary first.

    Printed is what a reader of the JSON has: a page shows settings in the order of their keys, and
    who judged may hold them in another one.
    """
    report = parse_report(report_bytes(report), gate=report.gate)
    base = Path(report_path(report.gate))
    rows, folder = rows_of(root, report), rows_folder(report.gate)
    return {
        base.with_suffix(".md").as_posix(): markdown(report).encode(),
        base.with_suffix(".html").as_posix(): gate_page(root, report, rows=rows).encode(),
        **{f"{folder}/{name}": data for name, data in printed_rows(rows, report).items()},
    }


def differing(
    root: Path, report: GateReport, *, recorded: frozenset[str] = frozenset(), whole: bool = True
) -> str:
    """The first printed file that is another one than its report gives; empty if none is.

    Args:
        root: Below which files and evidence lie.
        report: The report.
        recorded: Files and folders that are held against a record elsewhere.
        whole: Whether what was not printed counts; one missing file of a folder always does.
    """
    base, folder = Path(report_path(report.gate)), rows_folder(report.gate)
    pages = [base.with_suffix(suffix).as_posix() for suffix in (".md", ".html")]
    places = {
        place
        for place in (*pages, folder)
        if place not in recorded and (whole or (root / place).exists())
    }
    if not places:
        return ""
    expected = printed_beside(root, report)
    lying = {path.relative_to(root).as_posix() for path in (root / folder).rglob("*")}
    for name in (*pages, *sorted({*expected, *lying} - {*pages})):
        if name not in places and not (folder in places and name.startswith(f"{folder}/")):
            continue
        file = root / name
        if name not in expected or not file.is_file() or file.read_bytes() != expected[name]:
            return name
    return ""
