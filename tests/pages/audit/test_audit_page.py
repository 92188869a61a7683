"""The audit's page: every number on it is in the evidence, the first red layer is marked."""

import json
import re
import sys
from html.parser import HTMLParser
from pathlib import Path

import numpy as np
import pandas as pd
import pytest

sys.path.insert(0, str(Path(__file__).parents[2] / "audit"))

from planar import LIMITS, SETTINGS, admissible, planar

from gates.cause import Answer, CauseName, cause_of
from gates.cause import Layer as CauseLayer
from genpolicy.audit.evidence import write_evidence
from genpolicy.audit.run import audit
from genpolicy.errors import BadInputError
from genpolicy.pages.audit.evidence import read_evidence
from genpolicy.pages.audit.ladder import OPEN, RED, UNBELIEVED, ladder
from genpolicy.pages.audit.page import audit_page, label_table, recovery_table
from genpolicy.pages.audit.words import MARKS, MEANINGS, TITLES, TONES

CASES = {
    "valid": {"episodes": 100, "recoveries": 6},
    "clock": {"episodes": 100, "clock_steps": 3},
    "labels": {"episodes": 100, "wrong_labels": 0.3},
    "operator": {"episodes": 100, "modes": "operator"},
    "one": {"episodes": 90, "modes": "none"},
}
BLANK = {"evidence": [], "rests_on": ["Units were guessed: <b>tcp</b>."], "modes": []}


def document(folder):
    cause = cause_of(folder, LIMITS)
    return {
        "verdict": cause.name.value, "variable": cause.variable, "kind": cause.kind,
        "layer": cause.layer.value, "confidence": cause.confidence,
        "next_action": cause.next_action, "limits": LIMITS.as_json(), **BLANK,
        "questions": [answer.as_json() for answer in cause.answers],
        "dataset_manifest_sha256": "0" * 64,
    }  # fmt: skip


@pytest.fixture(scope="module")
def audits(tmp_path_factory):
    made = {}
    for name, options in CASES.items():
        folder = tmp_path_factory.mktemp(name)
        data, replayed = planar(**options)
        result = audit(
            data, SETTINGS, admissible=admissible, replay=replayed.__getitem__, root_seed=1
        )
        write_evidence(result, folder, settings=SETTINGS,
                       obstacles=[{"x_m": 0.15, "y_m": 0.0, "radius_m": 0.04}])  # fmt: skip
        made[name] = folder
    return made


@pytest.fixture(scope="module")
def pages(audits):
    return {
        name: audit_page(document(folder), read_evidence(folder), name="a <i>task</i>")
        for name, folder in audits.items()
    }


class Reader(HTMLParser):
    """Collects what a browser would load, and the values of all `<data>`."""

    def __init__(self, page):
        super().__init__()
        self.loaded, self.values, self.stack = [], [], []
        self.feed(page)

    def handle_starttag(self, tag, attrs):
        found = dict(attrs)
        if tag == "data":
            self.values.append(found["value"])
        if tag in ("script", "iframe", "object", "embed", "link"):
            self.loaded.append(tag)
        for key in ("src", "href", "xlink:href"):
            value = found.get(key)
            if value and not value.startswith(("#", "evidence/")):
                self.loaded.append(value)


@pytest.mark.parametrize("name", CASES)
def test_a_page_loads_nothing_and_escapes_what_comes_from_data(pages, name):
    page = pages[name]
    assert Reader(page).loaded == []
    assert "url(http" not in page and "@import" not in page and "default-src 'none'" in page
    assert "a &lt;i&gt;task&lt;/i&gt;" in page and "&lt;b&gt;tcp&lt;/b&gt;" in page
    assert "<i>task" not in page and "<b>tcp" not in page
    assert page.count("Not drawn") == {"one": 3}.get(name, 0)


def test_the_same_evidence_gives_the_same_bytes(audits, pages):
    folder = audits["valid"]
    again = audit_page(document(folder), read_evidence(folder), name="a <i>task</i>")
    assert again == pages["valid"]


@pytest.mark.parametrize(
    ("name", "red"),
    [("valid", None), ("clock", "data"), ("labels", "labels"), ("operator", "hidden"),
     ("one", "structure")],
)  # fmt: skip
def test_the_first_red_layer_is_marked_and_what_lies_below_is_not_believed(audits, name, red):
    evidence = read_evidence(audits[name])
    layers = ladder(document(audits[name]), evidence)
    assert [layer.name for layer in layers] == [layer.value for layer in CauseLayer][:-1]
    states = {layer.name: layer.state for layer in layers}
    assert [n for n, state in states.items() if state == RED] == ([red] if red else [])
    names = list(states)
    below = names[names.index(red) + 1 :] if red else []
    assert all(states[n] == UNBELIEVED for n in below)
    for layer in layers:
        beyond = [check for check in layer.checks if check.holds is False]
        if layer.state == RED:
            assert beyond, f"{layer.name} is red, and no number of it is beyond its limit"
        elif layer.state != UNBELIEVED:
            assert not beyond, f"{layer.name} holds, but {beyond}"


def test_numbers_on_the_page_are_those_of_the_evidence(audits, pages):
    summary = json.loads((audits["valid"] / "summary.json").read_text())
    values = Reader(pages["valid"]).values
    for number in (
        document(audits["valid"])["confidence"], summary["label_disagreement_upper"],
        float(summary["counts"]["two_mode_episodes"]), LIMITS["label_disagreement"],
    ):  # fmt: skip
        assert json.dumps(number) in values
    for folder in (audits["valid"], audits["clock"]):
        files = {path.name for path in folder.iterdir()}
        assert files == set(read_evidence(folder).digests)


def test_nothing_replayed_leaves_the_labels_open_not_green(audits, tmp_path):
    data, _ = planar(episodes=90)
    result = audit(data, SETTINGS, admissible=None, replay=None, root_seed=1)
    write_evidence(result, tmp_path, settings=SETTINGS)
    evidence = read_evidence(tmp_path)
    states = {layer.name: layer.state for layer in ladder(document(tmp_path), evidence)}
    assert states["labels"] == OPEN
    page = audit_page(document(tmp_path), evidence, name="no simulator")
    assert "No episode was replayed" in page and "mean, not checked" in page
    assert label_table(evidence) == []


def test_labels_are_told_by_mode_and_in_all(audits):
    evidence = read_evidence(audits["labels"])
    rows = label_table(evidence)
    assert rows[-1]["mode"] == "all" and len(rows) >= 3
    for key in ("count", "agree", "lost", "gained"):
        assert rows[-1][key] == sum(row[key] for row in rows[:-1])
    total = rows[-1]
    assert total["agree"] + total["lost"] + total["gained"] == total["count"]
    assert total["count"] - total["agree"] == evidence.summary["label_disagreements"]


def test_recovery_has_an_exact_interval():
    frame = pd.DataFrame([{"split": "train", "mode": "m0", "episodes": 10, "successes": 10}])
    (row,) = recovery_table(frame)
    # Clopper-Pearson for 10 of 10 at 95 %: lower end 0.025 ** (1 / 10).
    assert row["upper"] == 1.0 and np.isclose(row["lower"], 0.025**0.1)


@pytest.mark.parametrize(
    ("measured", "limit", "comparison", "holds"),
    [(1.0, 1.0, "<=", True), (1.1, 1.0, "<=", False), (1.0, 1.0, ">=", True),
     (0.9, 1.0, ">=", False), (float("nan"), 1.0, "<=", False), (float("nan"), 1.0, ">=", False),
     (None, 1.0, "<=", None), (1.0, None, "<=", None)],
)  # fmt: skip
def test_a_number_holds_only_if_it_is_one(measured, limit, comparison, holds):
    assert Answer("x", CauseLayer.DATA, "x", measured, limit, comparison).holds is holds


def test_every_cause_has_its_words():
    causes = {cause.value for cause in CauseName}
    assert set(TITLES) == set(MEANINGS) == set(TONES) == causes
    assert set(MARKS) == {"holds", RED, OPEN, UNBELIEVED}


def test_figures_and_tables_have_names_for_those_who_do_not_see_them(pages):
    page = pages["valid"]
    drawings = re.findall(r'<svg role="img" aria-label="([^"]+)"', page)
    assert len(drawings) == len(set(drawings)) == 7
    assert page.startswith("<!DOCTYPE html>") and '<html lang="en">' in page
    assert page.count("<h1>") == 1 and page.count("<main>") == 1
    identifiers = re.findall(r'\bid="([^"]+)"', page)
    assert len(identifiers) == len(set(identifiers)), "two figures share an inner name"


def test_damaged_evidence_is_refused(audits, tmp_path):
    import shutil

    shutil.copytree(audits["one"], tmp_path / "copy")
    (tmp_path / "copy" / "strata.parquet").unlink()
    with pytest.raises(BadInputError):
        read_evidence(tmp_path / "copy")


def test_the_page_compares_nothing_of_its_own(audits):
    said = document(audits["valid"])
    said["questions"][0] |= {"measured": 99.0, "limit": 1.0, "holds": True}
    layers = ladder(said, read_evidence(audits["valid"]))
    shown = [check for layer in layers for check in layer.checks if check.measured == 99.0]
    assert [check.holds for check in shown] == [True]


def test_every_limit_stands_on_the_page_with_its_reason(pages):
    for question, item in LIMITS.by_question.items():
        assert question in pages["valid"]
        assert item.reason.split(",")[0].replace("'", "&#39;") in pages["valid"]
