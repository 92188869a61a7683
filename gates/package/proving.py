"""From a bundle to its verdicts, derived again elsewhere, by the code that runs there.

Nothing of a bundle is imported: its code must be, byte for byte, the code that runs, and its task
the one that is installed. What it says of itself (groups, statements, verdicts, pages) is made
again from its evidence.
"""

from dataclasses import replace
from pathlib import Path

from gates.installed import environment
from gates.package.archive import read_index, unpack
from gates.package.bundling import (
    BUNDLED,
    files_to_carry,
    groups_of,
    require_judged,
    statements_of,
)
from gates.package.contents import brought
from gates.package.index import BundleIndex
from gates.package.statements import statement_path
from gates.pages.printing import differing
from gates.pipeline import CODE, TASK
from gates.proof import Rung
from gates.report import read_report, report_path
from gates.reproducibility.settings import RELOAD
from gates.running import code_files
from gates.settings import read_params, section_of
from genpolicy.documents.task import IDENTITY
from genpolicy.errors import BadInputError, ConfigError, IntegrityError
from genpolicy.evidence.documents.reproducibility import CANDIDATES
from genpolicy.integrity.documents import canonical_json
from genpolicy.integrity.hashing import sha256_file
from genpolicy.tasks.identity import task_identity

INSTALLED = Path(__file__).resolve().parents[2]
SHORTEST_ADDRESS = 32
"""Digits of an address: a second bundle with the same ones cannot be made by trying."""


def prove_bundle(
    path: Path, folder: Path, *, address: str = "", run_programs: bool = False
) -> tuple[BundleIndex, list[Rung]]:
    """Derive everything that a bundle says, from its bytes.

    Args:
        path: Of the archive.
        folder: Empty folder to unpack it into.
        address: What was handed over by another way, or its first digits; empty if nothing was.
        run_programs: Whether policies that were brought may be started to ask them again.

    Returns:
        The index, and the state of gates A to D with their evidence derived again.

    Raises:
        IntegrityError: A byte, a statement, a page or a group is not what the evidence gives, or
            the verdicts are of other code, libraries or another task than there are here.
        BadInputError: The bundle cannot be read, has another address, or brings programs that
            nobody allowed to run.
        ConfigError: Its task is not installed, or it names what lies outside of it.
        RefusedError: A report is missing or not what the files say.
    """
    _require_address(path, read_index(path), address)
    index, statements = unpack(path, folder)
    _require_address(path, index, address)  # of the bytes that are judged, once more
    _require_code(index, folder)
    _require_task(folder)
    _require_environment(folder)
    programs = sorted(policy.name for policy in brought(folder))
    if programs and not run_programs:
        raise BadInputError(
            where=str(path),
            found=f"programs of {', '.join(programs)}, which are asked again",
            expected="leave to start what somebody else wrote",
            action="Read their entries, then give `--run-programs`, best in a container.",
        )
    rungs = require_judged(folder)
    pinned = CANDIDATES.read(folder / RELOAD).get(index.candidate)
    if pinned is None or index.checkpoint != pinned.checkpoint:
        raise _untrue("the checkpoint", "another than the evidence names")
    again = statements_of(folder, index.candidate, index.checkpoint)
    for gate in BUNDLED:
        if again[gate] != statements.get(gate):
            raise _untrue(statement_path(gate), "not what the report of this gate gives")
    groups = groups_of(folder, index.candidate)
    if index.groups != groups:
        raise _untrue("the groups", "other than the evidence gives")
    beyond = sorted(set(index.files) ^ set(files_to_carry(folder, groups)))
    if beyond:
        raise _untrue("the files", f"without or beyond {beyond[0]}")
    _require_pages(folder)
    # What derives again loads simulation and compiled kernels: not to say that bytes differ.
    from gates.rederive import rederived  # noqa: PLC0415

    return index, [_as_stated(rung, index) for rung in rederived(folder, rungs)]


def _as_stated(rung: Rung, index: BundleIndex) -> Rung:
    """The rung, refused where the index states another verdict."""
    stated = index.verdicts.get(rung.gate, "nothing")
    if rung.verdict in (stated, "REFUSED"):
        return rung
    note = f"the index says {stated}, and the evidence {rung.verdict}"
    return replace(rung, verdict="REFUSED", decided_by="", note=note, exit_code=3)


def _require_address(path: Path, index: BundleIndex, address: str) -> None:
    if address and (len(address) < SHORTEST_ADDRESS or not index.address.startswith(address)):
        raise BadInputError(
            where=str(path),
            found=f"address {index.address}",
            expected=f"{address} (at least {SHORTEST_ADDRESS} digits)",
            action="This is another bundle than the one you were told of.",
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


def _require_task(folder: Path) -> None:
    """The task is the installed one: what the bundle says of it is never imported to be looked at.

    Raises:
        ConfigError: It is not installed.
        IntegrityError: It is another one.
    """
    name = section_of(read_params(folder), "task").get("name")
    if not isinstance(name, str):
        raise ConfigError(
            where="params.yaml: task.name",
            found=f"{name!r:.40}",
            expected="the name of a task",
            action="Ask for the bundle again, and compare its address.",
        )
    stated = IDENTITY.plain(IDENTITY.read(folder / TASK))
    if canonical_json(stated) != canonical_json(task_identity(name)):
        raise IntegrityError(
            where=f"{TASK}/{IDENTITY.file}",
            found="another task than is installed here under this name",
            expected="the task that was measured on",
            action=f"Install the version of the task {name!r} that the bundle is of.",
        )


def _require_environment(folder: Path) -> None:
    """Numbers are the same to the bit with the same libraries only."""
    here = environment()
    for gate in BUNDLED:
        if not (folder / report_path(gate)).is_file():
            continue
        there = read_report(folder, gate)[0].environment
        other = sorted(name for name in {*here, *there} if here.get(name) != there.get(name))
        if other:
            raise IntegrityError(
                where=f"{other[0]} on this machine",
                found=here.get(other[0], "absent"),
                expected=f"{there.get(other[0], 'absent')}, with which Gate {gate} was judged",
                action="Install what `constraints.txt` of that checkout pins.",
            )


def _require_pages(folder: Path) -> None:
    """Pages and rows that people read say what the reports say: each is printed once more."""
    for gate in BUNDLED:
        report, _ = read_report(folder, gate)
        if name := differing(folder, report):
            raise _untrue(name, "another page")


def _untrue(where: str, found: str) -> IntegrityError:
    return IntegrityError(
        where=where,
        found=found,
        expected="what the evidence in the bundle gives",
        action="Do not use this bundle; ask for one that `genpolicy package` wrote.",
    )
