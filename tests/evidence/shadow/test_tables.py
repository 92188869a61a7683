"""The shadow evidence as files, and the checker that holds sessions to the settings in force."""

from types import SimpleNamespace

import numpy as np
import pytest

from genpolicy.contract.chunk import DiscardReason
from genpolicy.evidence.documents.gallery import GALLERY
from genpolicy.evidence.documents.shadow import CHECKER, MUTANTS, LayerMutant
from genpolicy.evidence.shadow.gallery import gallery_of
from genpolicy.evidence.shadow.observations import held_out_observations
from genpolicy.evidence.shadow.shadow import HELD_OUT, Shadow, shadow_policy
from genpolicy.evidence.shadow.tables import (
    account_rows,
    checker_document,
    write_shadow,
)
from genpolicy.execution.cell import Cell
from genpolicy.execution.ledger import Account
from genpolicy.integrity.tables import read_table
from genpolicy.seeds import stream


@pytest.fixture(scope="module")
def written(task, checker, data, policy, kit, tmp_path_factory):
    folder = tmp_path_factory.mktemp("shadow")
    shadow = Shadow(
        task=task, checker=checker, cell=Cell(kit.HORIZONS, kit.EXECUTION), late_rows=1,
        samples=2,
    )  # fmt: skip
    seen = held_out_observations(data, horizons=kit.HORIZONS, count=5, generator=stream(1, "s"))

    def demonstrated(observations, *, noise_names, candidates):
        chunks = {(o.episode_uuid, o.index): o.demonstrated for o in seen}
        good = np.stack([chunks[name[1:]] for name in noise_names])
        return SimpleNamespace(actions=np.stack([good] * candidates, axis=1), nfe=1)

    operator = SimpleNamespace(
        method="operator", checkpoint_hash="w", sampler_config_hash="s", sample=demonstrated
    )
    found = [shadow_policy(shadow, item, seen, seed=0) for item in (operator, policy)]
    mutants = [
        LayerMutant(
            check="expired", layer="fresh", fixture="expired", behind=[], detected=True, tried=1,
            violations=1, not_applicable="",
        )
    ]  # fmt: skip
    gallery = gallery_of(shadow, seen, [row for item in found for row in item.candidates])
    write_shadow(folder, found, mutants, gallery, cell=shadow.cell, robot=shadow.checker.cell)
    return folder


def test_all_files_are_there_and_agree(written):
    stub = read_table(written / "stub.parquet").to_pandas()
    assert (stub["stale"] == 0).all() and (stub["invalid"] == 0).all()
    assert set(stub["method"]) == {"operator", "flow"}
    counts = read_table(written / "counts.parquet").to_pandas()
    for _, part in counts.groupby(["method", "fixture"]):
        totals = part.iloc[0]
        ended = totals["executed"] + totals["queued"] + part["count"].sum()
        assert totals["generated"] == ended
    checked = CHECKER.read(written)
    shown = {example.method for example in GALLERY.read(written).examples}
    assert shown == {"flow"}  # little trained; all that the operator did is admitted
    assert checked.violations == []
    assert checked.checked_actions == stub["arrivals"].sum() > 0
    candidates = read_table(written / "candidates.parquet").to_pandas()
    assert (candidates["fixture"] == HELD_OUT).sum() == 2 * 5 * 2
    mutants = MUTANTS.read(written)
    assert mutants[0].check == "expired"
    assert all(row.layer == "execution" and row.detected for row in mutants[1:])
    assert len(mutants) > 10


@pytest.mark.parametrize(
    ("name", "value"), [("watchdog_s", 0.2), ("queue_capacity", 9), ("maximum_age_s", None)]
)
def test_sessions_under_other_settings_are_flagged(written, kit, checker, name, value):
    if value is None:
        value = {phase: age + 1.0 for phase, age in kit.EXECUTION.maximum_age_s.items()}
    execution = kit.EXECUTION.model_copy(update={name: value})
    found = checker_document(
        [written / "journal.mcap"], cell=Cell(kit.HORIZONS, execution), robot=checker.cell
    )
    rules = {violation.rule for violation in found.violations}
    assert rules == {"settings.limits"}
    assert all(violation.journal == "journal.mcap" for violation in found.violations)


def test_another_execution_horizon_is_flagged(written, kit, checker):
    horizons = kit.HORIZONS.model_copy(update={"execution_horizon": 4})
    found = checker_document(
        [written / "journal.mcap"], cell=Cell(horizons, kit.EXECUTION), robot=checker.cell
    )
    assert found.violations


def test_accounts_add_up_over_sessions():
    accounts = [
        Account(generated=5, executed=2, discarded={DiscardReason.EXPIRED: 3}, queued=0),
        Account(generated=4, executed=1, discarded={DiscardReason.RESET: 2}, queued=1),
        Account(generated=1, executed=0, discarded={DiscardReason.EXPIRED: 1}, queued=0),
    ]
    # By hand: 10 generated, 3 executed, 1 queued; 4 expired, 2 reset.
    assert account_rows(accounts) == [
        {"generated": 10, "executed": 3, "queued": 1, "reason": "expired", "count": 4},
        {"generated": 10, "executed": 3, "queued": 1, "reason": "reset", "count": 2},
    ]
    kept = [Account(generated=1, executed=1, discarded={}, queued=0)]
    assert account_rows(kept) == [
        {"generated": 1, "executed": 1, "queued": 0, "reason": "", "count": 0}
    ]
