"""Reports of another run: in a folder, or as a revision of the repository holds them."""

from pathlib import Path

from gates.git import git
from gates.report import GATES, Gate, GateReport, parse_report, report_path
from genpolicy.errors import BadInputError
from genpolicy.integrity.hashing import sha256_bytes_of


def reports_of(place: str, root: Path) -> dict[Gate, GateReport]:
    """Reports that lie in a folder, or that a revision of git holds; as they lie there, not proved.

    Args:
        place: A checkout or a folder `reports`, or a revision of the repository: a commit, a tag.
            A folder of that name comes first.
        root: Repository root, for revisions.

    Raises:
        BadInputError: Neither, or no report is there.
        IntegrityError: A report is malformed or of another schema version.
    """
    folder = Path(place)
    texts = _of_folder(folder) if folder.is_dir() else _of_revision(place, root)
    if not texts:
        there = folder.is_dir() or _is_revision(place, root)
        raise BadInputError(
            where=place,
            found="without a report of a gate" if there else "no folder and no revision",
            expected=f"a checkout, a folder with {Path(report_path('A')).name}, or a commit",
            action="Name two runs, as in `genpolicy report diff HEAD~1 reports`. Of a branch that "
            "holds no reports yet there is nothing to compare with.",
        )
    return {gate: parse_report(data, gate=gate) for gate, data in texts.items()}


def _of_folder(folder: Path) -> dict[Gate, bytes]:
    found: dict[Gate, bytes] = {}
    for gate in GATES:
        name = report_path(gate)
        here = [path for path in (folder / name, folder / Path(name).name) if path.is_file()]
        if here:
            found[gate] = sha256_bytes_of(here[0], keep=True)[1]
    return found


def _of_revision(revision: str, root: Path) -> dict[Gate, bytes]:
    if not _is_revision(revision, root):
        return {}
    texts = {
        gate: git(root, "show", "--end-of-options", f"{revision}:./{report_path(gate)}")
        for gate in GATES
    }
    return {gate: text.encode() for gate, text in texts.items() if text is not None}


def _is_revision(text: str, root: Path) -> bool:
    return git(root, "rev-parse", "--verify", "-q", "--end-of-options", text) is not None
