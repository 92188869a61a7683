"""What the checker answers, as a document: times in s, reasons in order, every violation."""

from collections import Counter

from genpolicy.verification.report import CheckReport, Violation


def test_a_document_says_everything_once_in_seconds():
    report = CheckReport(
        violations=[Violation("a", 7, "P1.age", "Too old.")], sessions=2, events=30,
        checked_actions=5, checked_fallback_actions=1, chunks=3,
        discarded=Counter({"late": 2, "expired": 1}), oldest_action_ns=600_000_000,
        longest_silence_ns=150_000_000,
    )  # fmt: skip
    document = report.as_document()
    (violation,) = document.violations
    assert vars(violation) == {"session": "a", "event": 7, "rule": "P1.age", "text": "Too old."}
    assert (document.oldest_action_s, document.longest_silence_s) == (0.6, 0.15)
    assert list(document.discarded) == ["expired", "late"]
    assert (document.sessions, document.events, document.chunks) == (2, 30, 3)
    assert (document.checked_actions, document.checked_fallback_actions) == (5, 1)


def test_reports_share_no_list():
    one, other = CheckReport(), CheckReport()
    one.violations.append(Violation("a", 0, "P1.age", ""))
    one.checks_missing.add("window")
    assert other.violations == [] and other.checks_missing == set()
