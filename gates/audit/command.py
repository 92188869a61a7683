"""`genpolicy audit`: is there a need for a generator in these data, and if not, why?

The audit measures; the cause is named by `gates.cause`, the same function as in Gate A, under the
limits of a `params.yaml` or the packaged ones.
"""

import os
import shutil
import time
from collections.abc import Mapping
from importlib.metadata import version
from pathlib import Path
from typing import Any

from gates.audit.importing import AuditOptions, say
from gates.cause import Answer, Cause, CauseLimits, Topic, cause_of, default_limits
from gates.need.gate import read_cause_limits
from genpolicy.audit.documents import Obstacle
from genpolicy.audit.evidence import write_evidence
from genpolicy.audit.propose import propose_settings
from genpolicy.audit.settings import AuditSettings
from genpolicy.audit.standalone import AuditReport, audit
from genpolicy.cli.remember import Answers, remembered_admissible, remembered_replay
from genpolicy.cli.resume import DATASET, work_folder
from genpolicy.cli.task_checks import TaskChecks, task_checks
from genpolicy.data.dataset import Dataset, load_dataset
from genpolicy.data.formats import Opened
from genpolicy.data.formats.contract import write_contract
from genpolicy.integrity.atomic import output_folder, write_bytes
from genpolicy.integrity.documents import canonical_json
from genpolicy.integrity.hashing import sha256_bytes
from genpolicy.pages.audit.evidence import read_evidence
from genpolicy.pages.audit.origins import named, origins_of, origins_shown
from genpolicy.pages.audit.page import audit_page
from genpolicy.pages.audit.words import TITLES
from genpolicy.progress import ProgressLine

DOCUMENT, PAGE, CONTRACT, EVIDENCE = "audit.json", "audit.html", "contract.yaml", "evidence"
SHOWN_REFUSALS = 5


def run_audit(options: AuditOptions, opened: Opened) -> int:
    """Audit what was imported, write everything or nothing, and print the verdict."""
    began_s = time.monotonic()
    out = options.out
    limits = given_limits(options.limits)
    work = work_folder(out)
    say(f"{opened.accepted} episodes accepted, {len(opened.refused)} refused; auditing")
    dataset = load_dataset(opened.folder)
    origins = origins_of(dataset)
    settings = propose_settings(dataset, source=opened.contract.model_dump(mode="json"))
    checks = task_checks(dataset, task=options.task, chunk_rows=settings.chunk_rows)
    report = _audited(options, dataset, settings, checks, work)
    say("writing the evidence and the page")
    with output_folder(out) as folder:
        write_contract(folder / CONTRACT, opened.contract)
        name = name_of(dataset, options.path)
        cause = write_report(
            report,
            folder,
            limits=limits,
            name=name,
            obstacles=checks.obstacles,
            origins=origins,
        )
        if opened.folder == work / DATASET:
            os.replace(opened.folder, folder / DATASET)
    shutil.rmtree(work, ignore_errors=True)
    print(named(as_text(report, cause, opened, out), origins))
    print(limits_text(limits, options.limits))
    say(f"audited in {time.monotonic() - began_s:.1f} s")
    return 0


def given_limits(path: Path | None) -> CauseLimits:
    """Limits of the cause from a `params.yaml`; the packaged ones where none is given.

    Raises:
        ConfigError: A limit is missing or wrong.
    """
    return default_limits() if path is None else read_cause_limits(path)


def write_report(
    report: AuditReport,
    folder: Path,
    *,
    limits: CauseLimits,
    name: str,
    obstacles: list[Obstacle],
    origins: Mapping[str, str] | None = None,
) -> Cause:
    """Write audit.json, audit.html and the evidence into an existing folder.

    Args:
        report: What the audit measured.
        folder: Existing folder.
        limits: Limits of the cause.
        name: What the dataset is called on the page.
        obstacles: Round obstacles of the scene plane, for figures.
        origins: What the user calls an episode, by identifier.

    Returns:
        The cause, named from what was written.
    """
    evidence = folder / EVIDENCE
    evidence.mkdir()
    write_evidence(report.result, evidence, settings=report.settings, obstacles=obstacles)
    cause = cause_of(evidence, limits)
    document, written = judged(report, cause, limits), read_evidence(evidence)
    document["episodes"] = origins_shown(document, written, origins or {})
    write_bytes(folder / DOCUMENT, canonical_json(document))
    page = audit_page(document, written, name=name)
    write_bytes(folder / PAGE, page.encode())
    return cause


def judged(report: AuditReport, cause: Cause, limits: CauseLimits) -> dict[str, Any]:
    """`audit.json`: what was measured, the cause, and every question with its limit."""
    return report.as_json() | {
        "verdict": cause.name.value,
        "variable": cause.variable,
        "kind": cause.kind,
        "layer": cause.topic.value,
        "confidence": cause.confidence,
        "agreeing_draws": list(cause.agreeing),
        "found": list(cause.found),
        "next_action": cause.next_action,
        "questions": [answer.as_json() for answer in cause.answers],
        "limits": limits.as_json(),
        "coverage": limits.confidence,
    }


def name_of(dataset: Dataset, path: Path) -> str:
    """The task's name where the data state one, else that of the file or folder."""
    tasks = [str(task) for task in dataset.manifest["tasks"]]
    return tasks[0] if len(tasks) == 1 and tasks[0] != "unnamed" else path.resolve().name


def as_text(report: AuditReport, cause: Cause, opened: Opened, out: Path) -> str:
    """The verdict for a person at a terminal."""
    parts = [part.replace("_", " ") for part in (cause.variable, cause.kind) if part]
    said = f"{cause.name} ({', '.join(dict.fromkeys(parts))})" if parts else cause.name.value
    red = "no topic is red" if cause.topic is Topic.NONE else f"first red topic: {cause.topic}"
    beyond = tuple(_beyond(answer) for answer in cause.answers if answer.topic is cause.topic)
    same, draws = cause.agreeing
    agree = "contradict what all of them say" if cause.topic is Topic.AGREEMENT else "say the same"
    sure = f"{same} of {draws} resampled audits {agree}" if draws else "confidence unknown"
    lines = [
        *_block("verdict", (said, f"{TITLES[cause.name]}; {sure}; {red}")),
        *_block("found", cause.found),
        *_block("judged", beyond),
        *_block("evidence", report.evidence),
        *_block("rests on", report.rests_on),
        *_block("next", (cause.next_action,)),
    ]
    refused = tuple(refusal.reason for refusal in opened.refused)
    shown, more = refused[:SHOWN_REFUSALS], len(refused) - SHOWN_REFUSALS
    lines += _block("refused", (*shown, f"and {more} more") if more > 0 else shown)
    lines.append(f"page        {out / PAGE}")
    return "\n".join(lines)


def limits_text(limits: CauseLimits, path: Path | None) -> str:
    """Every limit of the cause in one line each, and where they are from."""
    origin = "packaged; --limits gives others" if path is None else str(path)
    lines = [
        f"{question} {item.limit:g} ({item.owner})" for question, item in limits.by_question.items()
    ]
    sure = f"intervals cover {limits.confidence:.0%}"
    return "\n".join(_block("limits", (origin, *lines, sure)))


def _beyond(answer: Answer) -> str:
    measured = "unknown" if answer.measured is None else f"{answer.measured:.3g}"
    limit = "no limit" if answer.limit is None else f"{answer.comparison} {answer.limit:.3g}"
    return f"{answer.what}: {measured}, {limit}{', red' if answer.red else ''}"


def _block(title: str, texts: tuple[str, ...]) -> list[str]:
    return [f"{title if number == 0 else '':<12}{text}" for number, text in enumerate(texts)]


def _audited(
    options: AuditOptions,
    dataset: Dataset,
    settings: AuditSettings,
    checks: TaskChecks,
    work: Path,
) -> AuditReport:
    """The audit, with a progress line; slow checks are remembered beside the output."""
    rests = [dataset.manifest_sha256, settings.model_dump(mode="json"), version("genpolicy")]
    answers = Answers(work / f"answers-{sha256_bytes(canonical_json(rests))[:16]}.jsonl")
    lines: dict[str, ProgressLine] = {}

    def progress(what: str, done: int, total: int) -> None:
        if what not in lines:
            for line in lines.values():
                line.close()
            lines[what] = ProgressLine(what)
        lines[what](done, total)

    replay, admissible = checks.replay, checks.admissible
    try:
        return audit(
            dataset,
            settings,
            admissible=None if admissible is None else remembered_admissible(admissible, answers),
            replay=None if replay is None else remembered_replay(replay, answers),
            root_seed=options.seed,
            progress=progress,
        )
    finally:
        for line in lines.values():
            line.close()
