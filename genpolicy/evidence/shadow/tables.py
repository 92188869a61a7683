"""The shadow evidence as files: candidates, stub, balances, holds, journal, checker and others."""

from collections.abc import Sequence
from pathlib import Path
from typing import Any

from genpolicy.evidence.documents.gallery import GALLERY, Gallery
from genpolicy.evidence.documents.shadow import (
    CHECKER,
    MUTANTS,
    Checked,
    JournalViolation,
    LayerMutant,
    Mutant,
)
from genpolicy.evidence.rows.brought import FixtureAgainRow
from genpolicy.evidence.rows.shadow import (
    CandidateRow,
    ShadowCountRow,
    ShadowHoldRow,
    ShadowStubRow,
)
from genpolicy.evidence.shadow.clause_mutants import clause_mutants
from genpolicy.evidence.shadow.continuity_mutants import continuity_mutants
from genpolicy.evidence.shadow.found import ShadowEvidence
from genpolicy.evidence.shadow.holds import hold_rows
from genpolicy.evidence.shadow.mutants import run_mutants
from genpolicy.evidence.shadow.place_mutants import place_mutants
from genpolicy.evidence.shadow.stop_mutants import stop_mutants
from genpolicy.evidence.shadow.vote_mutants import vote_mutants
from genpolicy.execution.cell import Cell
from genpolicy.execution.figures import expected_settings
from genpolicy.execution.journal import write_journal
from genpolicy.execution.ledger import Account
from genpolicy.feasibility.cell import Cell as FeasibilityCell
from genpolicy.feasibility.figures import expected_motion
from genpolicy.integrity.rows import write_rows
from genpolicy.tasks.api import Task
from genpolicy.verification.checker import check_journal
from genpolicy.verification.report import JournalReport


def write_shadow(
    folder: Path,
    found: Sequence[ShadowEvidence],
    mutants: list[LayerMutant],
    gallery: Gallery,
    *,
    cell: Cell,
    robot: FeasibilityCell,
    again: Sequence[FixtureAgainRow] = (),
) -> None:
    """Write everything; the checker reads the journal back from the file.

    Args:
        folder: Existing folder.
        found: Evidence of each method.
        mutants: Disabled checks of the six layers.
        gallery: Examples of what was rejected.
        cell: What every session must have run under.
        robot: What every executed row must keep to.
        again: Gate B's fixtures, asked again of those that were brought.
    """
    write_rows(folder / "fixtures.parquet", FixtureAgainRow, again)
    candidates = [row for item in found for row in item.candidates]
    write_rows(folder / "candidates.parquet", CandidateRow, candidates)
    stub = [row for item in found for row in _stub_rows(item)]
    write_rows(folder / "stub.parquet", ShadowStubRow, stub)
    counts = [
        ShadowCountRow(method=method, fixture=fixture, **row)
        for item in found
        for (method, fixture), accounts in sorted(item.accounts.items())
        for row in account_rows(accounts)
    ]
    write_rows(folder / "counts.parquet", ShadowCountRow, counts)
    sessions = [session for item in found for session in item.sessions]
    write_rows(folder / "holds.parquet", ShadowHoldRow, hold_rows(sessions))
    journal = folder / "journal.mcap"
    write_journal(journal, sessions)
    CHECKER.write(folder, checker_document([journal], cell=cell, robot=robot))
    MUTANTS.write(folder, all_mutants(mutants))
    GALLERY.write(folder, gallery)


def all_mutants(layers: list[LayerMutant]) -> list[Mutant]:
    """Content of `mutants.json`: checks of the six layers, then those of the execution.

    The executor's checks are owned by freshness and hand-over, layer six and beyond. Behind them
    come what the supervisor stops for, each place at which the executor's checks are asked, and
    each of their clauses.
    """
    rows = [*run_mutants(), *vote_mutants(), *stop_mutants()]
    return [*layers, *rows, *place_mutants(), *clause_mutants(), *continuity_mutants()]


def account_rows(accounts: Sequence[Account]) -> list[dict[str, Any]]:
    """Totals of several sessions, one row per reason; one row without reason if there is none."""
    discarded: dict[str, int] = {}
    for account in accounts:
        for reason, count in account.discarded.items():
            discarded[str(reason)] = discarded.get(str(reason), 0) + count
    totals = {
        "generated": sum(account.generated for account in accounts),
        "executed": sum(account.executed for account in accounts),
        "queued": sum(account.queued for account in accounts),
    }
    reasons = sorted(discarded.items()) or [("", 0)]
    return [{**totals, "reason": reason, "count": count} for reason, count in reasons]


def checker_document(
    journals: Sequence[Path],
    *,
    cell: Cell,
    robot: FeasibilityCell,
    task: Task | None = None,
) -> Checked:
    """What the independent checker says of journal files; content of `checker.json`.

    The settings that every session must have run under come from `params.yaml`, not from the
    journal.

    Args:
        journals: The files.
        cell: The settings.
        robot: What actions were checked in.
        task: The task, where sessions are on the virtual clock and state what was measured.
    """
    expected = expected_settings(cell)
    motion = (
        expected_motion(robot)
        if task is None
        else expected_motion(robot, task.action_at, task.scene_poses)
    )
    return checked(
        {path.name: check_journal(path, expected, motion).as_document() for path in journals}
    )


def checked(journals: dict[str, JournalReport]) -> Checked:
    """What was found in each journal, added up.

    Args:
        journals: By name of the file.
    """
    return Checked(
        violations=[
            JournalViolation(**vars(violation), journal=name)
            for name, report in journals.items()
            for violation in report.violations
        ],
        checked_actions=sum(report.checked_actions for report in journals.values()),
        reproved_actions=sum(report.reproved_actions for report in journals.values()),
        journals=journals,
    )


def _stub_rows(evidence: ShadowEvidence) -> list[ShadowStubRow]:
    seen = evidence.stub
    return [
        ShadowStubRow(
            method=method,
            fixture=fixture,
            delivered=seen[(method, fixture, "delivered")],
            arrivals=seen[(method, fixture, "arrivals")],
            stale=seen[(method, fixture, "stale")],
            invalid=seen[(method, fixture, "invalid")],
        )
        for method, fixture in sorted({(method, fixture) for method, fixture, _ in seen})
    ]
