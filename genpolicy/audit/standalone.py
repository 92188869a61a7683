"""The audit of any ingested dataset, as one value: what was measured and all that it rests on."""

from dataclasses import asdict, dataclass
from typing import Any

from genpolicy.audit.component_rows import NOT_LOOKED_AT, OTHER
from genpolicy.audit.labels import Replay, disagreement
from genpolicy.audit.mean_versus_modes import Admissible
from genpolicy.audit.progress import Progress, silent
from genpolicy.audit.propose import propose_settings
from genpolicy.audit.question_names import COLUMN, OUTCOME_MISSING
from genpolicy.audit.run import AuditResult
from genpolicy.audit.run import audit as audit_rows
from genpolicy.audit.settings import AuditSettings
from genpolicy.audit.view import from_dataset
from genpolicy.data.dataset import Dataset

SCHEMA_VERSION = 2


@dataclass(frozen=True)
class AuditReport:
    """What `audit.json` says, all but the cause: that is named where the limits are.

    Attributes:
        modes: Episodes, successes and feasibility of each mode.
        support: How far the data reach.
        evidence: What each layer measured, a sentence each.
        rests_on: What was guessed, not recorded or not checked, a sentence each.
        settings: The settings of the audit, proposed ones included.
        dataset: Hash of the dataset's manifest.
        result: All evidence; not part of the document.
    """

    modes: tuple[dict[str, Any], ...]
    support: dict[str, Any]
    evidence: tuple[str, ...]
    rests_on: tuple[str, ...]
    settings: AuditSettings
    dataset: str
    result: AuditResult

    def as_json(self) -> dict[str, Any]:
        """The document, ready for `canonical_json`."""
        return {
            "schema_version": SCHEMA_VERSION,
            "modes": list(self.modes),
            "support": self.support,
            "evidence": list(self.evidence),
            "rests_on": list(self.rests_on),
            "settings": self.settings.model_dump(),
            "dataset_manifest_sha256": self.dataset,
        }


def audit(
    dataset: Dataset,
    config: AuditSettings | None = None,
    *,
    admissible: Admissible | None = None,
    replay: Replay | None = None,
    root_seed: int = 0,
    progress: Progress | None = None,
) -> AuditReport:
    """Audit an ingested dataset.

    Args:
        dataset: A verified dataset, see `genpolicy.data.dataset.load_dataset`.
        config: What counts as near, as two modes, and from where on deviations are reported;
            proposed from the data where None, see `genpolicy.audit.propose.propose_settings`.
        admissible: Feasibility of a chunk, `(actions (K, D_a), observation (D_o,)) -> (bool,
            reason)`; None: no mean and no mode is checked.
        replay: Outcome of a replayed episode, by identifier; None: labels are taken as they are.
        root_seed: Seed of all draws.
        progress: Called as `progress(what, done, total)`.

    Returns:
        The evidence; the same for every order of episodes.

    Raises:
        ContractError: The settings name what the dataset does not have.
    """
    settings = config or propose_settings(dataset)
    data = from_dataset(
        dataset,
        contract=dataset.observation_contract,
        settings=settings,
        period_s=float(dataset.manifest["action_contract"]["period_s"]),
    )
    result = audit_rows(
        data,
        settings,
        admissible=admissible,
        replay=replay,
        root_seed=root_seed,
        progress=progress or silent,
    )
    return AuditReport(
        modes=tuple(asdict(mode) for mode in result.modes),
        support=_support(result),
        evidence=tuple(_evidence(result, settings)),
        rests_on=tuple(_rests_on(dataset, result)),
        settings=settings,
        dataset=dataset.manifest_sha256,
        result=result,
    )


def _support(result: AuditResult) -> dict[str, Any]:
    """How far the data reach, in all and by phase."""
    counts = result.counts
    return {
        "episodes": len(result.data.episodes),
        "rows": len(result.data.observation),
        "situations": counts.queries,
        "situations_with_support": counts.analysed,
        "held_out_episodes_with_support": counts.analysed_episodes,
        "by_phase": [
            {"phase": item.phase, "situations": item.queries, "with_support": item.analysed}
            for item in result.support
        ],
    }


def _evidence(result: AuditResult, settings: AuditSettings) -> list[str]:
    """What the layers measured, in the order of the diagnosis."""
    counts, persistence = result.counts, result.persistence
    wrong, replays = disagreement(result.replayed)
    found = [
        f"{item.kind} {item.variable}".strip() + f" {item.measured:.3g} {item.unit}"
        for item in result.semantics.findings
    ]
    lines = [
        f"data: {', '.join(found)}" if found else "data: nothing stands out of the noise",
        f"labels: {wrong} of {replays} replayed episodes disagree"
        if replays
        else "labels: not replayed",
        f"support: {counts.analysed} of {counts.queries} held-out situations have "
        f"{settings.minimum_neighbours} or more comparable training episodes, from "
        f"{counts.analysed_episodes} held-out episodes",
        f"structure: {counts.two_mode} situations from {counts.two_mode_episodes} held-out "
        f"episodes have several modes of {result.component.name}; after realignment "
        f"{result.modes_after_realignment}",
    ]
    if persistence.n:
        lines.append(
            f"persistence: {persistence.observed:.2f} of the episodes keep their mode, "
            f"{persistence.null_q95:.2f} is what chance reaches"
        )
    tested = [row for row in result.strata if row.p_adjusted is not None and row.n]
    if tested:
        row = max(tested, key=lambda item: (item.effect or 0.0, item.variable))
        detail = f" ({row.detail})" if row.detail else ""
        lines.append(
            f"hidden: {len(tested)} variables tested; the strongest is {row.variable}{detail}, "
            f"effect {row.effect:.2f}, adjusted p {row.p_adjusted:.3f}"
        )
    lines += [
        f"validity: {mode.mode} in {mode.phase}: {mode.successes} of {mode.episodes} succeed, "
        f"{mode.admissible} of {mode.checked} modal chunks pass"
        for mode in result.modes
    ]
    return lines


def _reasons(result: AuditResult) -> list[str]:
    """Which recorded columns were held against the modes, and which not and why."""
    looked = sorted(
        f"{item.name} ({', '.join(item.also)} says the same)" if item.also else item.name
        for item in result.data.variables
    )
    lines = [f"Looked at as reasons: {', '.join(looked)}."] if looked else []
    why: dict[str, list[str]] = {}
    for name, reason in result.data.left_out:
        why.setdefault(reason, []).append(name)
    return lines + [
        f"Not looked at as a reason: {', '.join(names)} ({reason})."
        for reason, names in why.items()
    ]


def _rests_on(dataset: Dataset, result: AuditResult) -> list[str]:
    """Everything that was guessed, not recorded or not asked."""
    lines = [str(note) for note in dataset.manifest.get("notes", ())]
    lines += result.semantics.notes
    lines += _reasons(result)
    lines += [
        f"Not asked: {row.check.replace('_', ' ')} ({row.reason})."
        for row in result.asked
        if not row.asked and not row.check.startswith(COLUMN)
    ]
    if not any(result.data.episodes.outcome):
        lines.append(OUTCOME_MISSING)
    lines += [
        f"{item.component}: {NOT_LOOKED_AT[item.state]}, so nothing is said of its modes."
        for item in result.components
        if item.state in NOT_LOOKED_AT and item.component != OTHER
    ]
    return lines
