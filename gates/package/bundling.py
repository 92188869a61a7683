"""From a workspace to a bundle: complete, of reports that are what the files say, or none."""

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from pydantic import ValidationError

from gates.change_control import control_of, control_text
from gates.git import git
from gates.overriders import require_in_force
from gates.package.archive import write_archive
from gates.package.contents import brought, files_of_the_run
from gates.package.groups import GROUPS, contents
from gates.package.index import BundledFile, BundledGroup, BundleIndex
from gates.package.statements import DATASET, statement_of, statement_path
from gates.pipeline import CODE
from gates.proof import Rung, prove_all, verify_report
from gates.report import Gate, read_report
from gates.reproducibility.settings import RELOAD
from genpolicy.errors import BadInputError
from genpolicy.evidence.documents.reproducibility import CANDIDATES
from genpolicy.integrity.documents import canonical_json
from genpolicy.integrity.hashing import sha256_bytes, sha256_file

BUNDLED: tuple[Gate, ...] = ("A", "B", "C", "D")
"""Gates of measured evidence. A card is a matter of people: it stays where their keys are known."""


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

    A candidate that fails Gate D has a bundle too: what is carried is evidence, and the verdicts
    are whatever they are. One that fails below was not measured above, and has none.

    Args:
        root: Of the workspace.
        candidate: Its name.
        out: File to write; by default one below `build/bundles`, with the address in its name.

    Raises:
        RefusedError: A report of gates A to D is missing or not what the files say.
        BadInputError: A group is not complete, a file has a name that cannot be carried, or the
            place cannot be written.
        IntegrityError: A file cannot be read.
        ConfigError: The pipeline, the parameters or an entry cannot be read, or names what lies
            outside the workspace; or a limit is overridden by somebody who may not, or no longer.
    """
    rungs = require_judged(root)
    require_in_force(root, {gate: read_report(root, gate)[0] for gate in BUNDLED})
    groups = groups_of(root, candidate)
    checkpoint = CANDIDATES.read(root / RELOAD)[candidate].checkpoint
    statements = statements_of(root, candidate, checkpoint)
    try:
        index = BundleIndex(
            schema_version=1,
            candidate=candidate,
            checkpoint=checkpoint,
            commit=_commit(root),
            verdicts={rung.gate: rung.verdict for rung in rungs},
            groups=groups,
            files={name: _file(root / name) for name in files_to_carry(root, groups)},
            statements={gate: sha256_bytes(data) for gate, data in statements.items()},
            limits=control_text(control_of(root)).splitlines(),
        )
    except ValidationError as error:
        raise BadInputError(
            where=f"the bundle of {candidate!r}",
            found=error.errors()[0]["msg"],
            expected="files that every machine can write",
            action="Rename the file, and run its stage again.",
        ) from error
    path = out or root / "build" / "bundles" / f"{candidate}-{index.address[:12]}.zip"
    files = {statement_path(gate): data for gate, data in statements.items()}
    write_archive(path, index, files, root=root)
    return Packaged(path, index)


def require_judged(root: Path) -> list[Rung]:
    """Every gate that a bundle holds, judged, and its report what the files say.

    Raises:
        RefusedError: A report is missing or untrue; in the words of its own proof.
        IntegrityError: A report is malformed or of another schema version.
    """
    rungs = [rung for rung in prove_all(root) if rung.gate in BUNDLED]
    hashes: dict[Gate, str] = {}
    for rung in rungs:
        if rung.verdict in ("REFUSED", "NOT JUDGED"):
            verify_report(root, rung.gate, upstream=hashes)  # raises what it said, as it said it
        hashes[rung.gate] = sha256_file(root / rung.report)
    return rungs


def groups_of(root: Path, candidate: str) -> list[BundledGroup]:
    """The eleven groups, as an index names them.

    Raises:
        BadInputError: One is not complete.
    """
    own = candidate in {policy.name for policy in brought(root)}
    found = contents(root, candidate, brought=own)
    return [
        BundledGroup(
            number=group.number,
            title=group.title,
            files=list(found[group.number]),
            unmeasured=group.lacks(root, candidate),
        )
        for group in GROUPS
    ]


def files_to_carry(root: Path, groups: Sequence[BundledGroup]) -> list[str]:
    """Paths of all that a bundle holds, sorted."""
    return sorted({*files_of_the_run(root), *(name for group in groups for name in group.files)})


def statements_of(root: Path, candidate: str, checkpoint: str) -> dict[Gate, bytes]:
    """The statement of each gate, as it lies in a bundle."""
    dataset = sha256_file(root / DATASET)
    found: dict[Gate, bytes] = {}
    for gate in BUNDLED:
        report, digest = read_report(root, gate)
        statement = statement_of(
            report, digest=digest, candidate=candidate, checkpoint=checkpoint, dataset=dataset
        )
        found[gate] = canonical_json(statement)
    return found


def _commit(root: Path) -> str:
    """The commit that the code is of; empty where it is of none."""
    clean = git(root, "diff", "--quiet", "HEAD", "--", *CODE) is not None
    return (git(root, "rev-parse", "HEAD") or "") if clean else ""


def _file(path: Path) -> BundledFile:
    mode = path.stat()
    return BundledFile(
        sha256=sha256_file(path), size=mode.st_size, executable=bool(mode.st_mode & 0o100)
    )
