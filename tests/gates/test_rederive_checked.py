"""What a stage says of the checker's findings is what the checker finds, or is refused by name."""

from dataclasses import replace
from pathlib import Path

import pytest
import yaml

from gates.rederive import _held_to
from gates.rederive_checked import rederive_checked
from genpolicy.errors import BadInputError, RefusedError
from genpolicy.evidence.documents.shadow import CHECKER
from genpolicy.evidence.shadow.tables import checked
from genpolicy.execution.journal import Journal, write_journal
from genpolicy.verification.checker import check_journal

HELD_TO = _held_to(yaml.safe_load((Path(__file__).parents[2] / "params.yaml").read_text()))
FOLDER = "artifacts/some_stage"


@pytest.fixture
def journals(tmp_path):
    """Two journals of sessions that declare nothing, which is two violations in each."""
    (tmp_path / FOLDER).mkdir(parents=True)
    paths = [tmp_path / FOLDER / f"{name}.mcap" for name in ("one", "other")]
    for path in paths:
        journal = Journal(path.stem, {"method": "flow"})
        journal.add("session", 0, {"labels": journal.labels})
        write_journal(path, [journal])
    return paths


def told(root, journals):
    """Write what the checker says of some journals."""
    document = checked(
        {path.name: check_journal(path, *HELD_TO).as_document() for path in journals}
    )
    CHECKER.write(root / FOLDER, document)
    return document


def ask(root, journals):
    rederive_checked(root, "D", FOLDER, HELD_TO, journals)


def test_what_is_found_again_stands(tmp_path, journals):
    assert told(tmp_path, journals).violations
    ask(tmp_path, journals)


def test_a_journal_that_was_left_out_and_one_that_does_not_lie_there(tmp_path, journals):
    told(tmp_path, journals[:1])
    with pytest.raises(RefusedError, match=r"checker\.json: other\.mcap is nothing, required \d"):
        ask(tmp_path, journals)
    told(tmp_path, journals)
    with pytest.raises(RefusedError, match=r"other\.mcap is \d.* required nothing, as checked"):
        ask(tmp_path, journals[:1])


def test_a_finding_that_was_taken_back_is_refused_by_its_journal(tmp_path, journals):
    document = told(tmp_path, journals)
    clean = {name: replace(one, violations=[]) for name, one in document.journals.items()}
    CHECKER.write(tmp_path / FOLDER, replace(document, violations=[], journals=clean))
    with pytest.raises(
        RefusedError, match=r"one\.mcap is 0 violations in 0 actions, required [1-9]"
    ):
        ask(tmp_path, journals)


def test_a_total_that_its_journals_do_not_add_up_to_is_refused(tmp_path, journals):
    CHECKER.write(tmp_path / FOLDER, replace(told(tmp_path, journals), reproved_actions=3))
    with pytest.raises(RefusedError, match=r"checker\.json: reproved_actions is 3, required 0"):
        ask(tmp_path, journals)


def test_a_document_that_is_not_there_is_bad_input(tmp_path, journals):
    with pytest.raises(BadInputError, match=r"checker\.json"):
        ask(tmp_path, journals)
