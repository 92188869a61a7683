"""Who may override a limit, and until when: asked of whoever acts on a report."""

import datetime
import subprocess
from types import SimpleNamespace

import evidence
import pytest
import yaml
from cryptography.hazmat.primitives.asymmetric.ed25519 import Ed25519PrivateKey

from gates import commands
from gates.exceptions import utc_today
from gates.floors import LONGEST_DAYS
from gates.overriders import first_end, require_in_force, require_written
from gates.overrides import OVERRIDES
from gates.printed import problems_beside
from gates.proof import Rung
from gates.report import Overridden, report_path
from gates.reproducibility.settings import BROUGHT_FOLDER
from genpolicy.errors import ConfigError, IntegrityError
from genpolicy.evidence.documents.brought import BROUGHT

LAST = datetime.date(2026, 12, 24)
ENTRY = {
    "gate": "D", "criterion": "hold_share_upper", "candidate": "flow", "limit": 0.3,
    "by": "rita", "reason": "the cell waits", "expires": str(LAST),
}  # fmt: skip
ROLES = {
    "rita": "reviewer", "mo": "model", "sam": "safety", "ada": "author", "stan": "spotter",
}  # fmt: skip
KEYS = {n: Ed25519PrivateKey.generate().public_key().public_bytes_raw().hex() for n in ROLES}


def _record(**changes):
    values = {**ENTRY, "comparison": "<=", "threshold": 0.25, "verdict": "FAIL",
              "instead": "PASS", "without": "FAIL", **changes}  # fmt: skip
    return Overridden(**values)


@pytest.fixture
def root(tmp_path):
    """Settings, exceptions and people; no evidence."""
    (tmp_path / "params.yaml").write_text(
        yaml.safe_dump({**evidence.PARAMS, "card": {"authors": ["ada", "mo"]}})
    )
    people = [
        {"id": name, "name": name, "role": role, "public_key": KEYS[name],
         "emails": [f"{name}@example.org"]}
        for name, role in ROLES.items()
    ]  # fmt: skip
    (tmp_path / "reviewers.yaml").write_text(yaml.safe_dump({"people": people}))
    return tmp_path


def _write(root, **changes):
    (root / OVERRIDES).write_text(yaml.safe_dump({"overrides": [{**ENTRY, **changes}]}))


@pytest.mark.parametrize("days", [-LONGEST_DAYS, -1, 0])
def test_it_holds_to_its_last_day(root, days):
    _write(root)
    require_written(root, LAST + datetime.timedelta(days))
    reports = {"A": SimpleNamespace(overrides=()), "D": SimpleNamespace(overrides=(_record(),))}
    require_in_force(root, reports, LAST + datetime.timedelta(days))


@pytest.mark.parametrize("last", [LAST + datetime.timedelta(LONGEST_DAYS + 1), "9999-12-31"])
def test_no_exception_is_for_ever(root, last):
    _write(root, expires=str(last))
    text = r"days from now, expected a last day at most 90 days from 2026-12-24 \(UTC\)"
    with pytest.raises(ConfigError, match=text):
        require_written(root, LAST)
    with pytest.raises(ConfigError, match=text):
        entry = _record(expires=str(last))
        require_in_force(root, {"D": SimpleNamespace(overrides=(entry,))}, LAST)


@pytest.mark.parametrize("days", [1, 400])
def test_behind_its_last_day_it_is_refused_and_the_limit_counts_again(root, days):
    today = LAST + datetime.timedelta(days)
    _write(root)
    text = rf"over since 2026-12-24, .* not before {today} \(UTC\)\. Remove the entry"
    with pytest.raises(ConfigError, match=text) as refused:
        require_written(root, today)
    assert refused.value.exit_code == 2
    with pytest.raises(ConfigError, match=text):
        require_in_force(root, {"D": SimpleNamespace(overrides=(_record(),))}, today)
    (root / OVERRIDES).write_text("overrides: []\n")
    require_written(root, today)


def test_the_day_is_the_utc_one_where_nobody_says_it(root, monkeypatch):
    _write(root)
    monkeypatch.setattr("gates.overriders.utc_today", lambda: LAST)
    require_written(root)
    monkeypatch.setattr("gates.overriders.utc_today", lambda: LAST + datetime.timedelta(1))
    with pytest.raises(ConfigError, match="over since"):
        require_written(root)


@pytest.mark.parametrize(
    ("by", "text"),
    [
        ("ada", "ada, an author"),
        ("mo", "mo, an author"),  # an owner by the list, and named in card.authors
        ("stan", "stan, a spotter"),
        ("eve", "'eve', who is not on"),
        ("Rita", "'Rita', who is not on"),
        ("rit\u0430", "who is not on"),
    ],
)
def test_an_author_a_spotter_and_a_stranger_override_nothing(root, by, text):
    _write(root, by=by)
    with pytest.raises(ConfigError, match=text):
        require_written(root, LAST)
    with pytest.raises(ConfigError, match=text):
        require_in_force(root, {"D": SimpleNamespace(overrides=(_record(by=by),))}, LAST)


@pytest.mark.parametrize("by", ["rita", "sam"])
def test_a_reviewer_and_an_owner_may(root, by):
    _write(root, by=by)
    require_written(root, LAST)


@pytest.mark.parametrize("candidate", ["mine", None])
def test_the_maker_of_a_brought_candidate_overrides_nothing_for_it(root, monkeypatch, candidate):
    brought = {"mine": SimpleNamespace(author="SAM@example.org")}
    (root / BROUGHT_FOLDER).mkdir(parents=True)
    (root / BROUGHT_FOLDER / BROUGHT.file).write_text("{}")
    monkeypatch.setattr(type(BROUGHT), "read", lambda self, folder: brought)
    reports = {"D": SimpleNamespace(overrides=(_record(by="sam", candidate=candidate),))}
    with pytest.raises(ConfigError, match="sam, who made mine"):
        require_in_force(root, reports, LAST)
    require_in_force(root, {"D": SimpleNamespace(overrides=(_record(by="sam"),))}, LAST)


def test_without_an_exception_nobody_needs_a_list_of_people(tmp_path):
    (tmp_path / "params.yaml").write_text(yaml.safe_dump(evidence.PARAMS))
    require_written(tmp_path, LAST)
    require_in_force(tmp_path, {}, LAST)
    require_in_force(tmp_path, {"A": SimpleNamespace(overrides=())}, LAST)


def test_no_card_may_outlive_the_first_exception_that_ends():
    entries = [_record(), _record(candidate=None, expires="2026-12-01"),
               _record(candidate="diffusion", expires="2026-11-30")]  # fmt: skip
    assert first_end(entries, "flow") == "2026-12-01"
    assert first_end(entries[:1], "flow") == "2026-12-24"
    assert first_end(entries, "act") == "2026-12-01"
    assert first_end((), "flow") == ""


def test_a_gate_is_not_judged_under_an_exception_that_is_over_and_loses_no_report(root):
    """Nothing was judged: what stands there is what it was, and is proved as ever."""
    _write(root, expires="2020-01-01")
    report = root / report_path("D")
    report.parent.mkdir()
    report.write_text("{}")
    with pytest.raises(ConfigError, match="over since 2020-01-01"):
        commands.judge("D", root)
    assert report.read_text() == "{}"
    assert [path.name for path in report.parent.iterdir()] == [report.name]


def test_the_chain_is_not_green_on_an_exception_that_is_over(root, monkeypatch):
    rung = Rung("D", "n", "PASS", "", "", report_path("D"), 0)
    report = SimpleNamespace(overrides=(_record(expires="2020-01-01"),))
    monkeypatch.setattr("gates.printed.page_problem", lambda root: None)
    monkeypatch.setattr("gates.printed.read_report", lambda root, gate: (report, ""))
    ((name, text, file, code),) = problems_beside(root, [rung])
    assert (name, file, code) == ("override", OVERRIDES, 2) and "over since 2020-01-01" in text
    report.overrides = ()
    assert problems_beside(root, [rung]) == []


@pytest.fixture
def overridden(root, monkeypatch):
    """A report that stands on an exception of today, which lies there."""
    entry = {"expires": str(utc_today())}
    _write(root, **entry)
    report = SimpleNamespace(overrides=(_record(**entry),))
    monkeypatch.setattr("gates.printed.page_problem", lambda root: None)
    monkeypatch.setattr("gates.printed.read_report", lambda root, gate: (report, ""))
    return [Rung("D", "n", "PASS", "", "", report_path("D"), 0)]


def _git(root, *args, author="rita"):
    named = ("-c", f"user.name={author}", "-c", f"user.email={author}@example.org")
    subprocess.run(["git", "-C", str(root), *named, *args], check=True, capture_output=True)


def test_the_chain_is_not_green_on_what_somebody_says_for_another(root, overridden, capsys):
    """To write `by: rita` takes nothing; to commit it as she takes a lie."""
    _git(root, "init", "-q")
    ((name, text, file, code),) = problems_beside(root, overridden)
    assert (name, file) == ("override", OVERRIDES) and "not committed as it lies here" in text
    assert code == IntegrityError.exit_code != 0
    _git(root, "add", "-A")
    _git(root, "commit", "-q", "-m", "x", author="ada")
    ((_, text, _, _),) = problems_beside(root, overridden)
    assert "committed by ada@example.org, expected a commit of rita" in text
    _git(root, "commit", "-q", "--amend", "--no-edit", "--reset-author")
    assert problems_beside(root, overridden) == []
    assert capsys.readouterr().err == ""


def test_without_a_history_it_is_said_that_nobody_knows_who_committed_it(root, overridden, capsys):
    assert problems_beside(root, overridden) == []
    assert "overrides.yaml: who committed it is not known: the repos" in capsys.readouterr().err
