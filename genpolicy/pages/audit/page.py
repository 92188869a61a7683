"""audit.html: one self-contained file that a reviewer reads in ten minutes.

Autoescape is on and nothing from data is marked safe; the only markup passed in are the figures
drawn here and the style sheet. Numbers stand as `<data value="...">` with the JSON number.
"""

import json
from collections.abc import Mapping
from dataclasses import replace
from typing import Any

import pandas as pd
from jinja2 import Environment, PackageLoader, StrictUndefined
from markupsafe import Markup

from genpolicy.audit.documents import Summary
from genpolicy.integrity.documents import canonical_json
from genpolicy.integrity.hashing import sha256_bytes
from genpolicy.pages.audit.evidence import AuditEvidence
from genpolicy.pages.audit.kinds import kinds, record_next
from genpolicy.pages.audit.ladder import ladder
from genpolicy.pages.audit.origins import named
from genpolicy.pages.audit.pictures import draw_all
from genpolicy.pages.audit.words import MARKS, MEANINGS, READING, TITLES, TONES, WORDS, short
from genpolicy.pages.figures.checks import NO_MODE
from genpolicy.pages.style import page_style
from genpolicy.statistics.intervals import clopper_pearson

SHOWN_EPISODES = 12


def audit_page(document: Mapping[str, Any], evidence: AuditEvidence, *, name: str) -> str:
    """HTML of one audit; the same inputs give the same bytes.

    Args:
        document: `audit.json`, with the cause, its questions, its limits and the coverage of their
            intervals; `episodes`, if it is there, says what the user calls the episodes named.
        evidence: The evidence beside it.
        name: What the dataset is called.
    """
    environment = Environment(
        loader=PackageLoader("genpolicy.pages.audit"),
        autoescape=True,
        undefined=StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
    )
    own, _, _ = PackageLoader("genpolicy.pages.audit").get_source(environment, "audit.css")
    cause, limits = str(document["verdict"]), _limits(document["limits"])
    origins = document.get("episodes", {})
    said, rests_on = named(document, origins), named(document["rests_on"], origins)
    summary = replace(evidence.summary, notes=named(evidence.summary.notes, origins))
    evidence = replace(
        evidence, summary=summary, origins=origins, coverage=float(document["coverage"])
    )
    return environment.get_template("audit.html").render(
        style=page_style() + Markup(own),
        name=name,
        report=said,
        title=TITLES.get(cause, cause.replace("_", " ")),
        meaning=MEANINGS.get(cause, ""),
        tone=TONES.get(cause, "open"),
        named=_named(said),
        marks=MARKS,
        topics=ladder(said, evidence),
        kinds=kinds(evidence),
        record_next=record_next(document, evidence),
        guessed=[line for line in rests_on if is_guess(line)],
        rests_on=[line for line in rests_on if not is_guess(line)],
        pictures=draw_all(evidence, {row["question"]: row["limit"] for row in limits}),
        limits=limits,
        labels=label_table(evidence),
        wrong=_wrong(evidence["replay"], origins),
        recovery=recovery_table(evidence),
        phases=_phases(summary),
        summary=summary,
        settings=evidence.settings,
        digests=evidence.digests,
        digest=sha256_bytes(canonical_json(dict(document))),
        reading=READING,
        words=WORDS,
        short=short,
        exact=json.dumps,
        plain=lambda value: json.dumps(value, ensure_ascii=False),
    )


def is_guess(line: str) -> bool:
    """Whether a line of what the report rests on is about something that was guessed."""
    return any(word in line.lower() for word in ("guess", "times are row / rate"))


def _limits(by_owner: Mapping[str, Mapping[str, Any]]) -> list[dict[str, Any]]:
    """Every limit of the cause with its owner and reason, by question."""
    rows = [
        {"question": question, "limit": value[0], "reason": value[1], "owner": owner}
        for owner, questions in by_owner.items()
        for question, value in questions.items()
    ]
    return sorted(rows, key=lambda row: str(row["question"]))


def label_table(evidence: AuditEvidence) -> list[dict[str, Any]]:
    """Replayed episodes by mode: how many, and which labels the replay turns over.

    Returns:
        One row per mode and one for all; none where nothing was replayed.
    """
    frame = evidence["replay"]
    if len(frame) == 0:
        return []
    modes = frame["mode"].fillna(NO_MODE)
    parts = [(str(mode), frame[modes == mode]) for mode in sorted(set(modes))]
    if len(parts) > 1:
        parts.append(("all", frame))
    return [_labels(mode, part, evidence.coverage) for mode, part in parts]


def recovery_table(evidence: AuditEvidence) -> list[dict[str, Any]]:
    """Disturbed episodes per split and mode, with the exact interval of their success."""
    rows = []
    for _, row in evidence["recovery"].sort_values(["split", "mode"]).iterrows():
        successes, episodes = int(row["successes"]), int(row["episodes"])
        lower, upper = clopper_pearson(successes, episodes, evidence.coverage)
        rows.append(
            {
                "split": str(row["split"]),
                "mode": str(row["mode"]),
                "episodes": episodes,
                "successes": successes,
                "lower": lower,
                "upper": upper,
            }
        )
    return rows


def _labels(mode: str, part: pd.DataFrame, coverage: float) -> dict[str, Any]:
    good, replayed = part["label"] == "success", part["replayed"] == "success"
    wrong, count = int((part["label"] != part["replayed"]).sum()), len(part)
    lower, upper = clopper_pearson(wrong, count, coverage)
    return {
        "mode": mode,
        "count": count,
        "agree": count - wrong,
        "lost": int((good & ~replayed).sum()),
        "gained": int((~good & replayed).sum()),
        "lower": lower,
        "upper": upper,
    }


def _wrong(frame: pd.DataFrame, origins: Mapping[str, str]) -> tuple[list[str], int]:
    """The first episodes whose label disagrees, and how many more there are."""
    found = frame.loc[frame["label"] != frame["replayed"], "episode_uuid"].tolist()
    shown = [origins.get(uuid, uuid) for uuid in found[:SHOWN_EPISODES]]
    return shown, len(found) - len(shown)


def _named(document: Mapping[str, Any]) -> str:
    """Variable and kind of the verdict, where it names them."""
    parts = [str(document[key]).replace("_", " ") for key in ("variable", "kind")]
    return ", ".join(dict.fromkeys(part for part in parts if part))


def _phases(summary: Summary) -> str:
    """What looking at the phase does to the modes, a sentence; empty where nothing is to say."""
    inside, across = summary.modes_with_phase, summary.modes_without_phase
    if inside == across:
        return ""
    return (
        f"Inside each phase {inside} held-out episodes show several modes, across phases {across}."
    )
