"""An exception of who was brought holds for a while, and is told before anything trains."""

import datetime
from types import SimpleNamespace

import evidence
import pytest
import yaml

from gates.exceptions import require_unmatched, unmatched_written, utc_today
from gates.floors import LONGEST_DAYS
from gates.overriders import require_in_force, require_written
from gates.package.bundling import package
from gates.printed import problems_beside
from gates.proof import Rung
from gates.report import report_path
from genpolicy.errors import ConfigError

LAST = datetime.date(2026, 12, 24)
ENTRY = {"owner": "model", "reason": "trained by its maker", "expires": str(LAST)}


def written(**changes):
    return unmatched_written({"gate_b": {"unmatched": {"mine": ENTRY | changes}}})


@pytest.mark.parametrize("days", [-LONGEST_DAYS, -1, 0])
def test_it_holds_to_its_last_day(days):
    require_unmatched(written(), LAST + datetime.timedelta(days), brought=["mine"])


@pytest.mark.parametrize(("expires", "text"), [
    ("2026-12-23", r"over since 2026-12-23, expected a last day that is not before 2026-12-24"),
    ("9999-12-31", r"days from now, expected a last day at most 90 days from 2026-12-24 \(UTC\)"),
])  # fmt: skip
def test_over_or_for_ever_it_is_refused_by_its_place(expires, text):
    with pytest.raises(ConfigError, match=text) as refused:
        require_unmatched(written(expires=expires), LAST)
    assert refused.value.exit_code == 2
    assert str(refused.value).startswith("params.yaml: gate_b.unmatched.mine is ")


@pytest.mark.parametrize("brought", [[], ["other"]])
def test_one_of_nobody_who_was_brought_is_refused(brought):
    with pytest.raises(ConfigError, match="an exception of nobody who was brought") as refused:
        require_unmatched(written(), LAST, brought=brought)
    assert ("other" in str(refused.value)) == bool(brought)
    require_unmatched(written(), LAST)  # behind the stage that asks for it


@pytest.mark.parametrize("change", [
    {"owner": "bob"}, {"reason": " "}, {"expires": "2027-02-30"}, {"expires": "soon"}, {"more": 1},
])  # fmt: skip
def test_a_malformed_one_is_refused(change):
    with pytest.raises(ConfigError, match=r"gate_b\.unmatched\.mine"):
        written(**change)


@pytest.mark.parametrize("gate", [None, {}, {"unmatched": {}}])
def test_there_may_be_none(gate):
    assert unmatched_written({}) == unmatched_written({"gate_b": gate}) == {}


def test_who_judges_or_goes_on_asks_for_the_day(tmp_path):
    """A report is derived again for ever; nobody judges, admits or signs under what is over."""
    gate = {**evidence.PARAMS["gate_b"], "unmatched": {"mine": ENTRY}}
    (tmp_path / "params.yaml").write_text(yaml.safe_dump({**evidence.PARAMS, "gate_b": gate}))
    reports = {"B": SimpleNamespace(overrides=(), settings={"unmatched": {"mine": ENTRY}})}
    for ask in (lambda day: require_written(tmp_path, day),
                lambda day: require_in_force(tmp_path, reports, day)):  # fmt: skip
        ask(LAST)
        with pytest.raises(ConfigError, match="over since 2026-12-24"):
            ask(LAST + datetime.timedelta(1))


def test_neither_the_chain_nor_a_bundle_is_green_under_one_that_is_over(monkeypatch, tmp_path):
    """Both looked at the last report alone, which says nothing of `gate_b.unmatched`."""
    report = SimpleNamespace(
        overrides=(), settings={"unmatched": {"mine": {**ENTRY, "expires": "2020-01-01"}}}
    )
    rungs = [Rung(gate, "n", "PASS", "", "", report_path(gate), 0) for gate in "ABCD"]
    monkeypatch.setattr("gates.printed.page_problem", lambda root: None)
    monkeypatch.setattr("gates.printed.read_report", lambda root, gate: (report, ""))
    ((name, text, _, code),) = problems_beside(tmp_path, rungs)
    assert (name, code) == ("override", 2) and "unmatched.mine is over since 2020-01-01" in text
    assert problems_beside(tmp_path, rungs[:1]) == []
    monkeypatch.setattr("gates.package.bundling.require_judged", lambda root: rungs)
    monkeypatch.setattr("gates.package.bundling.read_report", lambda root, gate: (report, ""))
    with pytest.raises(ConfigError, match="over since 2020-01-01"):
        package(tmp_path, "mine")


def test_today_is_the_day_in_utc():
    assert utc_today() == datetime.datetime.now(datetime.UTC).date()
