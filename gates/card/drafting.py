"""Drafting the trial card from the passed ladder: what the card stage calls."""

from collections.abc import Mapping
from pathlib import Path

from gates.card.card import CardSettings, TrialCard, draft_card, promoted, thresholds_of
from gates.card.envelope import simulated_envelope, was_judged
from gates.card.rollback import rollback_of
from gates.card.searched import searched_caveats
from gates.card.windows import windows_of
from gates.evidence import Evidence
from gates.report import Gate, GateReport
from gates.reproducibility.settings import RELOAD
from gates.settings import read_params, read_settings
from genpolicy.errors import IntegrityError
from genpolicy.evidence.documents.reproducibility import CANDIDATES


def draft(root: Path, reports: Mapping[Gate, GateReport], hashes: Mapping[Gate, str]) -> TrialCard:
    """The draft of an admitted card stage; the fields of the reviewer stay empty.

    Args:
        root: Repository root.
        reports: Of gates A to D, proved and passed, as `admit("card", root)` returns them.
        hashes: SHA-256 of those reports.

    Raises:
        ConfigError: Section `card` is missing or wrong.
        IntegrityError: Gate B pinned no checkpoint of the promoted candidate, no rollouts of
            it ran inside an envelope, or there is no simple policy to go back to.
        RefusedError: Gate D promotes no one.
    """
    settings = read_settings(read_params(root), "card", CardSettings)
    candidate = promoted(reports["D"])
    simulated = simulated_envelope(Evidence(root))
    if not was_judged(reports["D"], simulated.condition):
        raise IntegrityError(
            where="reports/gate_d.json: settings.perturbations",
            found=f"without {simulated.condition!r}",
            expected="the condition that ran inside the card's envelope",
            action="Judge gate D again: `dvc repro gate_d`.",
        )
    pinned = CANDIDATES.read(root / RELOAD).get(candidate)
    if pinned is None or not pinned.checkpoint:
        raise IntegrityError(
            where=f"{RELOAD}/{CANDIDATES.file}: {candidate}.checkpoint",
            found="missing",
            expected="the hash of the promoted checkpoint",
            action="Run `dvc repro reload`.",
        )
    thresholds = thresholds_of(reports["D"])
    card = draft_card(
        settings,
        reports,
        hashes,
        pinned.checkpoint,
        simulated=simulated,
        windows=windows_of(Evidence(root), candidate, simulated.condition, thresholds),
        rollback=rollback_of(reports, Evidence(root)).text,
    )
    caveats = dict.fromkeys([*card.caveats, *searched_caveats(root, candidate)])
    return card.model_copy(update={"caveats": tuple(caveats)})
