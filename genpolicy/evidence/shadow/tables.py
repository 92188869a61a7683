"""The shadow evidence as files: candidates, stub, balances, journal, checker and mutants."""

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import pyarrow as pa

from genpolicy.contract.horizons import HorizonConfig
from genpolicy.evidence.shadow.mutants import run_mutants
from genpolicy.evidence.shadow.shadow import ShadowEvidence
from genpolicy.execution.cell import ExecutionSettings
from genpolicy.execution.journal import write_journal
from genpolicy.execution.ledger import Account
from genpolicy.feasibility.settings import LAYERS
from genpolicy.integrity.atomic import write_bytes
from genpolicy.integrity.documents import canonical_json
from genpolicy.integrity.tables import write_table
from genpolicy.verification.checker import ExpectedSettings, check_journal

TEXT, WHOLE, REAL, FLAG = pa.string(), pa.int64(), pa.float64(), pa.bool_()

CANDIDATES = pa.schema(
    [
        ("method", TEXT), ("seed", WHOLE), ("fixture", TEXT), ("situation", TEXT),
        ("phase", TEXT), ("observation", WHOLE), ("candidate", WHOLE), ("mode", TEXT),
        *((layer, FLAG) for layer in LAYERS), ("first_reason", TEXT), ("layer_margin", REAL),
        ("position_change_m", REAL), ("rotation_change_rad", REAL), ("boundary_jerk_m_s3", REAL),
        ("raw", pa.list_(REAL)), ("projected", pa.list_(REAL)),
    ]
)  # fmt: skip
STUB = pa.schema(
    [
        ("method", TEXT), ("fixture", TEXT), ("delivered", WHOLE), ("arrivals", WHOLE),
        ("stale", WHOLE), ("invalid", WHOLE),
    ]
)  # fmt: skip
COUNTS = pa.schema(
    [
        ("method", TEXT), ("fixture", TEXT), ("generated", WHOLE), ("executed", WHOLE),
        ("queued", WHOLE), ("reason", TEXT), ("count", WHOLE),
    ]
)  # fmt: skip


def write_shadow(
    folder: Path,
    found: Sequence[ShadowEvidence],
    mutants: list[dict[str, Any]],
    candidates: pa.Table,
    *,
    horizons: HorizonConfig,
    execution: ExecutionSettings,
) -> None:
    """Write everything; the checker reads the journal back from the file.

    Args:
        folder: Existing folder.
        found: Evidence of each method.
        mutants: Disabled checks of the six layers.
        candidates: Table of the schema `CANDIDATES`.
        horizons: What every session must have run under.
        execution: The same.
    """
    write_table(folder / "candidates.parquet", candidates)
    stub = [row for item in found for row in _stub_rows(item)]
    write_table(folder / "stub.parquet", pa.Table.from_pylist(stub, STUB))
    counts = [
        {"method": method, "fixture": fixture, **row}
        for item in found
        for (method, fixture), accounts in sorted(item.accounts.items())
        for row in account_rows(accounts)
    ]
    write_table(folder / "counts.parquet", pa.Table.from_pylist(counts, COUNTS))
    journal = folder / "journal.mcap"
    write_journal(journal, [session for item in found for session in item.sessions])
    checked = checker_document([journal], horizons=horizons, execution=execution)
    write_bytes(folder / "checker.json", canonical_json(checked))
    # The executor's checks are owned by freshness and hand-over, layer six and beyond.
    executor = [{**row, "layer": "execution"} for row in run_mutants()]
    write_bytes(folder / "mutants.json", canonical_json([*mutants, *executor]))


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
    journals: Sequence[Path], *, horizons: HorizonConfig, execution: ExecutionSettings
) -> dict[str, Any]:
    """What the independent checker says of journal files; content of `checker.json`.

    The settings that every session must have run under come from `params.yaml`, not from the
    journal.
    """
    expected = ExpectedSettings(
        execution_horizon=horizons.execution_horizon,
        action_period_s=horizons.action_period_s,
        maximum_age_s=execution.maximum_age_s,
        watchdog_s=execution.watchdog_s,
        queue_capacity=execution.queue_capacity,
    )
    documents = {path.name: check_journal(path, expected).as_document() for path in journals}
    return {
        "violations": [
            {"journal": name, **violation}
            for name, document in documents.items()
            for violation in document["violations"]
        ],
        "checked_actions": sum(item["checked_actions"] for item in documents.values()),
        "journals": documents,
    }


def _stub_rows(evidence: ShadowEvidence) -> list[dict[str, Any]]:
    keys = sorted({(method, fixture) for method, fixture, _ in evidence.stub})
    return [
        {
            "method": method,
            "fixture": fixture,
            **{
                name: evidence.stub[(method, fixture, name)]
                for name in ("delivered", "arrivals", "stale", "invalid")
            },
        }
        for method, fixture in keys
    ]
