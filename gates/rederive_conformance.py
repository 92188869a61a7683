"""What brought policies answered at recorded moments: findings derived again, answers asked again.

The answers of the table give the findings of the document, with moments cut from the dataset again;
and a sample of the answers is asked of the candidate again. It is drawn by a hash of all tables of
the folder (`gates.sampled`).
"""

from collections import defaultdict
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from gates.rederive_again import TOLERANCE
from gates.rederive_brought import brought_policy
from gates.rederive_shadow import TaskSection
from gates.reproducibility.settings import RELOAD
from gates.sampled import salt_of, some
from gates.stated import refuse, root_seed, section
from genpolicy.candidates.conformance.asked import repeated
from genpolicy.candidates.conformance.check import question
from genpolicy.candidates.conformance.recorded_starts import RecordedStarts, recorded_starts
from genpolicy.candidates.wire.policy import WirePolicy, running
from genpolicy.contract.horizons import HorizonConfig
from genpolicy.data.dataset import load_dataset
from genpolicy.evidence.documents.conformance import CONFORMANCE, Conformance
from genpolicy.evidence.reproducibility.conformance import drawn, findings_again, invocation_of
from genpolicy.evidence.rows.brought import AGAIN, ANEW, FIRST, AnswerRow
from genpolicy.integrity.rows import read_rows
from genpolicy.tasks.api import load_task
from genpolicy.verification.journal_source import readable

DATASET = "artifacts/ingest"
ANSWERS = f"{RELOAD}/answers.parquet"
DOCUMENT = f"{RELOAD}/{CONFORMANCE.file}"
OF_A_CANDIDATE = 16
"""Answers of a candidate that are asked for again: of the first moments of the episodes, on which
nearly all findings stand, and as many of the others."""
REPEATS = ("answers", "repeats", "restarts", "seeded")
"""Where one of these fails, it is said that it answers otherwise when asked again, and it does."""


def rederive_conformance(root: Path, params: Mapping[str, Any]) -> None:
    """Hold findings against answers, and answers against the candidates.

    Raises:
        RefusedError: A finding does not follow from the answers, a candidate is without one or
            answers otherwise now, or it was asked about other moments than the seed draws.
        ConfigError: A section of `params.yaml` cannot be read.
        IntegrityError: A file is missing, or is not what it claims to be.
        PolicyError: A server does not start.
    """
    names = sorted(section_names(params))
    stated = CONFORMANCE.read(root / RELOAD)
    if set(stated) != set(names):
        refuse("B", DOCUMENT, f"findings of {', '.join(stated) or 'nobody'}",
               f"of {', '.join(names) or 'nobody'}, as section candidates says")  # fmt: skip
    if not names:
        return
    horizons = section(params, "horizons", HorizonConfig)
    data, task = load_dataset(root / DATASET), load_task(section(params, "task", TaskSection).name)
    starts = recorded_starts(data, horizons, seed=root_seed(params))
    answered: dict[str, list[AnswerRow]] = defaultdict(list)
    for row in read_rows(root / ANSWERS, AnswerRow):
        answered[row.method].append(row)
    for name in names:
        policy = brought_policy(root, params, name)
        assert policy is not None  # it is one of the section
        number = drawn(stochastic=policy.entry.stochastic)
        _hold_moments(name, answered[name], starts, started_here=policy.entry.started_here)
        _hold_findings(name, stated[name], answered[name], starts, candidates=number)
        if any(one.judged == "fails" for one in stated[name].findings if one.name in REPEATS):
            continue
        with running(policy, data.observation_contract, scene=task.scene_path) as wire:
            _ask_again(root, wire, stated[name], answered[name], starts)


def section_names(params: Mapping[str, Any]) -> list[str]:
    """Names of those that were brought."""
    found = params.get("candidates")
    return [str(name) for name in found] if isinstance(found, dict) else []


def _hold_moments(
    name: str, rows: Sequence[AnswerRow], starts: RecordedStarts, *, started_here: bool
) -> None:
    """Every moment once, and again those that the kit asks again: what differs is not left out."""
    for row in rows:
        if not 0 <= row.moment < len(starts) or starts.episodes[row.moment] != row.episode_uuid:
            refuse("B", f"{ANSWERS}: {name}/{row.moment}", row.episode_uuid, "a moment of its own")
    came = {row.moment for row in rows if row.session == FIRST and not row.fault}
    again = [moment for moment in repeated(starts.apart) if moment in came]
    for session, expected in (
        (FIRST, list(range(len(starts)))),
        (AGAIN, again),
        (ANEW, again if started_here else []),
    ):
        told = sorted(row.moment for row in rows if row.session == session)
        if told != expected:
            refuse("B", f"{ANSWERS}: {name}, {session}", f"{len(told)} moments",
                   f"{len(expected)}, each that was asked")  # fmt: skip


def _hold_findings(
    name: str,
    stated: Conformance,
    rows: Sequence[AnswerRow],
    starts: RecordedStarts,
    *,
    candidates: int,
) -> None:
    """What follows from the answers is what is said, word by word of what is judged.

    Numbers in a sentence may round otherwise on another processor, and are not compared.
    """
    place = f"{DOCUMENT}: {name}"
    asked = question(starts, dataset="", candidates=candidates)
    asked_of = (stated.candidates, stated.moments, stated.episodes)
    if asked_of != (candidates, len(starts), starts.apart):
        refuse("B", place, "{} chunks at {} moments of {} episodes".format(*asked_of),
               f"{candidates} at {len(starts)} of {starts.apart}, as the dataset has")  # fmt: skip
    if stated.observations_sha256 != asked.observations_sha256:
        refuse("B", place, "asked about other moments", "those that the root seed draws")
    with readable(ANSWERS):
        again = findings_again(rows, starts, stated)
    told = {one.name: f"{one.gate} {one.judged}" for one in stated.findings}
    if [one.name for one in stated.findings] != [one.name for one in again]:
        refuse(
            "B", place, ", ".join(told), f"{', '.join(one.name for one in again)}, in this order"
        )
    for one in again:
        if told[one.name] != f"{one.gate} {one.judged}":
            refuse("B", f"{place}: {one.name}", told[one.name],
                   f"{one.gate} {one.judged}, as its answers say ({one.said})")  # fmt: skip


def _ask_again(
    root: Path,
    wire: WirePolicy,
    stated: Conformance,
    rows: Sequence[AnswerRow],
    starts: RecordedStarts,
) -> None:
    """A sample of the answers, asked for again."""
    first = [row for row in rows if row.session == FIRST and not row.fault]
    if wire.absent:
        if first:
            refuse("B", f"{ANSWERS}: {wire.method}", f"{len(first)} answers of a server",
                   f"one that starts ({wire.remote})")  # fmt: skip
        return
    told = (wire.told.seeded, wire.told.counts_evaluations, wire.told.candidates)
    if told != (stated.seeded, stated.counts_evaluations, stated.most_candidates):
        refuse("B", f"{DOCUMENT}: {wire.method}", "other things that its server can", str(told))
    salt = salt_of((root / RELOAD).glob("*.parquet"))
    apart = [row for row in first if row.moment < starts.apart]
    further = [row for row in first if row.moment >= starts.apart]
    chosen = [
        *some(apart, OF_A_CANDIDATE, name=f"{wire.method}, apart", salt=salt),
        *some(further, OF_A_CANDIDATE, name=f"{wire.method}, further", salt=salt),
    ]
    for row in chosen:
        again = wire.sample(
            starts.observations[row.moment][None],
            noise_names=[("conformance", row.moment)],
            candidates=row.candidates,
        ).actions[0]
        written = invocation_of(row).actions
        same = again.shape == written.shape and np.allclose(
            again, written, rtol=0.0, atol=TOLERANCE, equal_nan=True
        )
        if not same:
            place = f"{ANSWERS}: {wire.method}/{row.moment}"
            refuse("B", place, "another answer than it gives now",
                   f"what it answers when asked again, within {TOLERANCE:g}")  # fmt: skip
