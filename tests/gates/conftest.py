"""Fixtures of the gate tests: a repository with evidence, with reports, with a drafted card."""

import shutil
import sys
from collections.abc import Callable, Generator
from functools import cache
from pathlib import Path

import pytest

sys.path.insert(0, str(Path(__file__).parent))

import evidence
from made_before import nothing_made_twice

from gates.card.card import card_bytes
from gates.card.drafting import draft
from gates.proof import judge
from gates.report import GATES, Gate, GateReport, read_report, report_bytes, report_path
from gates.writing import write_gate
from genpolicy.integrity.atomic import write_bytes
from genpolicy.statistics import clustered


def judge_all(root: Path, gates: str = "ABCD") -> None:
    """Write JSON reports without pages: quick."""
    for gate in GATES:
        if gate in gates:
            write_bytes(root / report_path(gate), report_bytes(judge(root, gate)))


def write_draft(root: Path) -> None:
    """Write the draft card of reports that were judged just now, so that none is proved again."""
    found = {gate: read_report(root, gate) for gate in GATES[:4]}
    reports = {gate: report for gate, (report, _) in found.items()}
    card = draft(root, reports, {gate: digest for gate, (_, digest) in found.items()})
    write_bytes(root / "artifacts/card/card.json", card_bytes(card))
    evidence.record(root)


@pytest.hookimpl(wrapper=True)
def pytest_runtest_protocol(item: pytest.Item) -> Generator[None, object, object]:
    """A tenth of the draws of an interval; what it covers is tested where it is made.

    For tests of this folder alone, what they share included: another test of the same process
    may judge what a real ladder has judged.
    """
    if Path(__file__).parent not in item.path.parents:
        return (yield)
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(clustered, "DRAWS", 200)
        with nothing_made_twice():
            return (yield)


@pytest.fixture(scope="session")
def _evidence(tmp_path_factory: pytest.TempPathFactory) -> Path:
    root = tmp_path_factory.mktemp("evidence")
    evidence.build(root)
    return root


@pytest.fixture(scope="session")
def _ladder(tmp_path_factory: pytest.TempPathFactory, _evidence: Path) -> Path:
    root = tmp_path_factory.mktemp("ladder") / "repo"
    shutil.copytree(_evidence, root)
    judge_all(root)
    write_draft(root)
    (root / "reviewers.yaml").write_text("people: []\n")
    return root


@pytest.fixture(scope="session")
def _written(tmp_path_factory: pytest.TempPathFactory, _ladder: Path) -> Path:
    """That ladder with the pages of every gate and the first page; nobody writes into it."""
    root = tmp_path_factory.mktemp("written") / "repo"
    shutil.copytree(_ladder, root)
    for gate in GATES:
        write_gate(root, gate)
    return root


@pytest.fixture(scope="session")
def judged(_ladder: Path) -> Callable[[Gate], GateReport]:
    """The report of a gate on the ladder as it is built, made once; nobody writes into it."""
    return cache(lambda gate: judge(_ladder, gate))


@pytest.fixture
def repo(tmp_path: Path, _evidence: Path) -> Path:
    """Evidence and settings, no report."""
    shutil.copytree(_evidence, tmp_path / "evidence")
    return tmp_path / "evidence"


@pytest.fixture
def ladder(tmp_path: Path, _ladder: Path) -> Path:
    """Evidence, reports A to D (all PASS) and a drafted card."""
    shutil.copytree(_ladder, tmp_path / "repo")
    return tmp_path / "repo"
