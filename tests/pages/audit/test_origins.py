"""What a person reads names the user's files, never our identifiers."""

import uuid
from dataclasses import replace
from types import SimpleNamespace

import pandas as pd
import pytest
from audited_cases import document

from genpolicy.pages.audit.evidence import read_evidence
from genpolicy.pages.audit.origins import named, origins_of, origins_shown, short_name
from genpolicy.pages.audit.page import audit_page

NAMES = [str(uuid.UUID(int=number)) for number in range(3)]
FILES = ["a<b>.hdf5#demo_7", "data/episode_000003.parquet", "$x.mcap"]
ORIGINS = dict(zip(NAMES, FILES, strict=True))


def test_identifiers_become_file_and_number():
    said = {"where": [f"2 episodes ({NAMES[0]}, {NAMES[1]})", 7], "other": str(uuid.UUID(int=9))}
    told = named(said, ORIGINS)
    assert told["where"] == ["2 episodes (a<b>.hdf5#demo_7, data/episode_000003.parquet)", 7]
    assert told["other"] == said["other"]
    assert [short_name(value) for value in ORIGINS.values()] == [
        "demo_7", "episode_000003.parquet", "$x.mcap",
    ]  # fmt: skip
    assert len(short_name("x" * 90)) == 24


def test_a_dataset_says_where_its_episodes_come_from():
    table = pd.DataFrame({"episode_uuid": NAMES, "source_file": ["a", "b", ""]})
    assert origins_of(SimpleNamespace(episodes=table)) == {NAMES[0]: "a", NAMES[1]: "b"}
    assert origins_of(SimpleNamespace(episodes=table[["episode_uuid"]])) == {}


@pytest.fixture
def told(audits):
    """A document whose defect names an episode, and evidence that asks with another."""
    said, evidence = document(audits["labels"]), read_evidence(audits["labels"])
    said["questions"][0]["note"] = f"jumps in {NAMES[0]}"
    summary = replace(evidence.summary, notes=[f"{NAMES[1]} waits at first."])
    examples = evidence["examples"].assign(query_uuid=NAMES[2])
    replayed = evidence["replay"].assign(episode_uuid=NAMES[1])
    tables = {**evidence.tables, "examples": examples, "replay": replayed}
    return said, replace(evidence, tables=tables, summary=summary)


def test_the_page_names_the_users_files(told):
    said, evidence = told
    before = audit_page(said, evidence, name="x")
    assert all(name in before for name in NAMES[:2]) and f"{NAMES[2][:8]}, row" in before
    said["episodes"] = origins_shown(said, evidence, {**ORIGINS, str(uuid.UUID(int=9)): "unnamed"})
    assert said["episodes"] == ORIGINS
    page = audit_page(said, evidence, name="x")
    assert not any(name in page for name in NAMES) and f"{NAMES[2][:8]}, row" not in page
    for text in ("jumps in a&lt;b&gt;.hdf5#demo_7", "data/episode_000003.parquet waits", "$x.mcap"):
        assert text in page
