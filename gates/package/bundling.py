"""From a workspace to a bundle, and from a bundle to its verdicts, derived again elsewhere."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path

from gates.git import git
from gates.package.archive import unpack, write_archive
from gates.package.contents import brought, files_of_the_run
from gates.package.groups import GROUPS, contents
from gates.package.index import BundledFile, BundledGroup, BundleIndex
from gates.package.statements import DATASET, statement_of, statement_path
from gates.pipeline import CODE
from gates.proof import Rung, prove_all
from gates.report import Gate, read_report
from gates.reproducibility.settings import RELOAD
from gates.running import code_files
from genpolicy.errors import BadInputError, IntegrityError, RefusedError
from genpolicy.evidence.documents.reproducibility import CANDIDATES
from genpolicy.integrity.documents import canonical_json
from genpolicy.integrity.hashing import sha256_bytes, sha256_file

MUST_STAND: tuple[Gate, ...] = ("A", "B", "C", "D")
"""Gates without which there is no evidence for some of the groups."""
INSTALLED = Path(__file__).resolve().parents[2]


@dataclass(frozen=True)
class Packaged:
    """A bundle that was written.

    Attributes:
        path: Of the archive.
        index: What is in it.
    """

    path: Path
    index: BundleIndex


def package(root: Path, candidate: str, out: Path | None = None) -> Packaged:
    """Write the bundle of a candidate: complete, or not at all.

    A candidate that fails a gate has a bundle too, as long as each group speaks of it: what is
    carried is evidence, and the verdicts are whatever they are.

    Args:
        root: Of the workspace.
        candidate: Its name.
        out: File to write; by default one below `build/bundles`, with the address in its name.

    Raises:
        RefusedError: A report of gates A to D is missing or not what the files say.
        BadInputError: A group is not complete, or the place cannot be written.
        IntegrityError: A file cannot be read.
        ConfigError: The pipeline, the parameters or an entry cannot be read.
    """
    rungs = prove_all(root)
    _require_judged(rungs)
    policies = {policy.name for policy in brought(root)}
    groups = contents(root, candidate, brought=candidate in policies)
    checkpoint = CANDIDATES.read(root / RELOAD)[candidate].checkpoint
    judged = [rung.gate for rung in rungs if rung.verdict not in ("NOT JUDGED", "REFUSED")]
    statements = _statements(root, judged, candidate, checkpoint)
    named = {*files_of_the_run(root), *(name for files in groups.values() for name in files)}
    index = BundleIndex(
        schema_version=1,
        candidate=candidate,
        checkpoint=checkpoint,
        commit=git(root, "rev-parse", "HEAD") or "",
        verdicts={rung.gate: rung.verdict for rung in rungs if rung.gate in judged},
        groups=[
            BundledGroup(
                number=group.number,
                title=group.title,
                files=list(groups[group.number]),
                unmeasured=group.unmeasured,
            )
            for group in GROUPS
        ],
        files={name: _file(root / name) for name in sorted(named)},
        statements={gate: sha256_bytes(data) for gate, data in statements.items()},
    )
    path = out or root / "build" / "bundles" / f"{candidate}-{index.address[:12]}.zip"
    files = {statement_path(gate): data for gate, data in statements.items()}
    write_archive(path, index, files, root=root)
    return Packaged(path, index)


def prove_bundle(path: Path, folder: Path, *, run_programs: bool) -> tuple[BundleIndex, list[Rung]]:
    """Derive everything that a bundle says, from its bytes, by the code that runs here.

    Args:
        path: Of the archive.
        folder: Empty folder to unpack it into; nothing in it is imported.
        run_programs: Whether policies that were brought may be started to ask them again.

    Returns:
        The index, and the state of each gate, with its evidence derived again.

    Raises:
        IntegrityError: A byte, a statement or a group is not what the index says, or the verdicts
            are of other code than runs here.
        BadInputError: The bundle cannot be read, or brings programs that nobody allowed to run.
        RefusedError: A report is missing or not what the files say.
    """
    index, statements = unpack(path, folder)
    _require_code(index, folder)
    programs = sorted(policy.name for policy in brought(folder))
    if programs and not run_programs:
        raise BadInputError(
            where=str(path),
            found=f"programs of {', '.join(programs)}, which are asked again",
            expected="leave to start what somebody else wrote",
            action="Read their entries, then give `--run-programs`, best in a container.",
        )
    rungs = prove_all(folder)
    _require_judged(rungs)
    judged = [rung.gate for rung in rungs if rung.gate in index.verdicts]
    again = _statements(folder, judged, index.candidate, index.checkpoint)
    for gate in sorted({*again, *statements}):
        if again.get(gate) != statements.get(gate):
            raise _untrue(statement_path(gate), "not what the report of this gate gives")
    pinned = CANDIDATES.read(folder / RELOAD).get(index.candidate)
    if pinned is None or index.checkpoint != pinned.checkpoint:
        raise _untrue("the checkpoint", "another than the evidence names")
    groups = contents(folder, index.candidate, brought=index.candidate in programs)
    stated = {group.number: tuple(group.files) for group in index.groups}
    if stated != dict(groups):
        raise _untrue("the groups", "other files than belong to them")
    # What derives again loads simulation and compiled kernels: not to say that bytes differ.
    from gates.rederive import rederived  # noqa: PLC0415

    return index, [_as_stated(rung, index) for rung in rederived(folder, rungs)]


def _as_stated(rung: Rung, index: BundleIndex) -> Rung:
    """The rung, refused where the index states another verdict."""
    stated = index.verdicts.get(rung.gate, "NOT JUDGED")
    if rung.verdict in (stated, "REFUSED"):
        return rung
    note = f"the index says {stated}, and the evidence {rung.verdict}"
    return replace(rung, verdict="REFUSED", decided_by="", note=note, exit_code=3)


def _require_judged(rungs: Sequence[Rung]) -> None:
    """Every gate that a bundle needs is judged, and its report is what the files say."""
    for rung in rungs:
        untrue = rung.verdict == "REFUSED"
        if untrue or (rung.gate in MUST_STAND and rung.verdict == "NOT JUDGED"):
            raise RefusedError(
                gate=rung.gate,
                criterion="the report",
                measured=rung.note,
                limit="a report that is what the files say",
                report=rung.report,
                action="Run the ladder; a bundle holds evidence of gates A to D.",
            )


def _require_code(index: BundleIndex, folder: Path) -> None:
    """The code that judged is the code that judges again; that of the bundle never runs."""
    there = {name: file.sha256 for name, file in index.files.items() if name.split("/")[0] in CODE}
    here = {f"{package}/{name}" for package in CODE for name in code_files(INSTALLED / package)}
    other = sorted(
        name
        for name in here | set(there)
        if name not in here or sha256_file(INSTALLED / name) != there.get(name)
    )
    if other:
        at = f" of commit {index.commit[:12]}" if index.commit else ""
        raise IntegrityError(
            where=f"{other[0]} in {folder}",
            found=f"other code than runs here ({len(other)} of {len(here | set(there))} files)",
            expected="the code that the verdicts are of",
            action=f"Verify with the checkout{at} that the bundle was packaged from.",
        )


def _statements(
    root: Path, judged: Sequence[Gate], candidate: str, checkpoint: str
) -> dict[Gate, bytes]:
    dataset = sha256_file(root / DATASET)
    found: dict[Gate, bytes] = {}
    for gate in judged:
        report, digest = read_report(root, gate)
        statement = statement_of(
            report, digest=digest, candidate=candidate, checkpoint=checkpoint, dataset=dataset
        )
        found[gate] = canonical_json(statement)
    return found


def _file(path: Path) -> BundledFile:
    return BundledFile(sha256=sha256_file(path), size=path.stat().st_size)


def _untrue(where: str, found: str) -> IntegrityError:
    return IntegrityError(
        where=where,
        found=found,
        expected="what the evidence in the bundle gives",
        action="Do not use this bundle; ask for one that `genpolicy package` wrote.",
    )
