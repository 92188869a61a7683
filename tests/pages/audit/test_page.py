"""The audit's page: every number on it is in the evidence, the first red layer is marked."""

import json
import re
from dataclasses import replace
from html.parser import HTMLParser

import nu_checker
import numpy as np
import pandas as pd
import pytest
from audited_cases import CASES, document
from markup import Markup
from planar import LIMITS

from genpolicy.pages.audit.evidence import read_evidence
from genpolicy.pages.audit.page import audit_page, label_table, recovery_table
from genpolicy.statistics.intervals import clopper_pearson


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


@pytest.mark.parametrize("name", CASES)
def test_the_markup_is_what_a_checker_takes(pages, name):
    assert Markup(pages[name]).wrong == []


@nu_checker.asked
def test_the_nu_checker_says_nothing_of_any_audit(pages, tmp_path):
    assert nu_checker.complaints(pages, tmp_path) == ""


def test_the_same_evidence_gives_the_same_bytes(audits, pages):
    folder = audits["valid"]
    again = audit_page(document(folder), read_evidence(folder), name="a <i>task</i>")
    assert again == pages["valid"]


def test_numbers_on_the_page_are_those_of_the_evidence(audits, pages):
    evidence = read_evidence(audits["valid"])
    values = Reader(pages["valid"]).values
    for number in (
        document(audits["valid"])["confidence"],
        clopper_pearson(0, len(evidence["replay"]))[1],
        float(evidence.summary.counts.two_mode_episodes), LIMITS["label_disagreement"],
    ):  # fmt: skip
        assert json.dumps(number) in values
    for folder in (audits["valid"], audits["clock"]):
        files = {path.name for path in folder.iterdir()}
        assert files == set(read_evidence(folder).digests)


def test_labels_are_told_by_mode_and_in_all(audits):
    evidence = replace(read_evidence(audits["labels"]), coverage=0.95)
    rows = label_table(evidence)
    assert rows[-1]["mode"] == "all" and len(rows) >= 3
    for key in ("count", "agree", "lost", "gained"):
        assert rows[-1][key] == sum(row[key] for row in rows[:-1])
    total = rows[-1]
    assert total["agree"] + total["lost"] + total["gained"] == total["count"]
    replay = evidence["replay"]
    assert total["count"] - total["agree"] == (replay["label"] != replay["replayed"]).sum() > 0


@pytest.mark.parametrize(("coverage", "tail"), [(0.95, 0.025), (0.99, 0.005)])
def test_recovery_has_an_exact_interval_of_the_coverage_that_judges(audits, coverage, tail):
    frame = pd.DataFrame([{"split": "train", "mode": "m0", "episodes": 10, "successes": 10}])
    evidence = read_evidence(audits["valid"])
    (row,) = recovery_table(replace(evidence, tables={"recovery": frame}, coverage=coverage))
    # Clopper-Pearson for 10 of 10: the lower end is the tail to the power of 1 / 10.
    assert row["upper"] == 1.0 and np.isclose(row["lower"], tail**0.1)


def test_figures_and_tables_have_names_for_those_who_do_not_see_them(pages):
    page = pages["valid"]
    drawings = re.findall(r'<svg role="img" aria-label="([^"]+)"', page)
    assert len(drawings) == len(set(drawings)) == 7
    assert page.startswith("<!DOCTYPE html>") and '<html lang="en">' in page
    assert page.count("<h1>") == 1 and page.count("<main>") == 1
    identifiers = re.findall(r'\bid="([^"]+)"', page)
    assert len(identifiers) == len(set(identifiers)), "two figures share an inner name"


def test_every_limit_stands_on_the_page_with_its_reason(pages):
    for question, item in LIMITS.by_question.items():
        assert question in pages["valid"]
        assert item.reason.split(",")[0].replace("'", "&#39;") in pages["valid"]
