"""Exceptions to limits: what may be one, and that none passes for a plain PASS."""

import copy
import math
from itertools import product

import evidence
import pytest
import yaml

from gates.card.card import caveats_of
from gates.doubts import of_a_ladder
from gates.floors import BOUNDS
from gates.moved import moved, moved_text
from gates.overrides import (
    NOBODY,
    OVERRIDDEN,
    OVERRIDES,
    Exceptions,
    Override,
    comparison_of,
    exceptions_of,
    read_overrides,
    rule,
    said,
)
from gates.pages.page import gate_page, index_page
from gates.pages.summary import markdown
from gates.proof import SPECS, judge, verify_report
from gates.report import Answer, read_report, report_bytes, report_path
from gates.settings import Limit, Limits, read_limits, read_params
from gates.verdicts import counting, decided_by, overridden_here
from genpolicy.errors import ConfigError
from genpolicy.integrity.atomic import write_bytes

ENTRY = {
    "gate": "D",
    "criterion": "hold_share_upper",
    "candidate": "flow",
    "limit": 0.3,
    "by": "rita",
    "reason": "the cell waits for the tray",
    "expires": "2026-12-24",
}
TOO_TIGHT = evidence.set_limit("gate_d", "hold_share_upper", 0.04)
"""Both candidates hold .05 of the time."""


def _read(tmp_path, *entries, params=evidence.PARAMS):
    (tmp_path / OVERRIDES).write_text(yaml.safe_dump({"overrides": list(entries)}))
    return read_overrides(tmp_path, params)


def test_without_a_file_or_an_entry_nobody_overrides(tmp_path):
    assert read_overrides(tmp_path, evidence.PARAMS) == ()
    assert _read(tmp_path) == ()
    (tmp_path / OVERRIDES).write_text("# nothing\n")
    assert read_overrides(tmp_path, evidence.PARAMS) == ()


def test_an_entry_is_read_as_it_is_written(tmp_path):
    assert _read(tmp_path, ENTRY) == (Override(**ENTRY),)


@pytest.mark.parametrize("name", ["gate", "criterion", "limit", "by", "reason", "expires"])
@pytest.mark.parametrize("empty", [None, "", "left out"])
def test_without_a_name_a_reason_or_a_last_day_it_is_refused(tmp_path, name, empty):
    entry = {**ENTRY, name: empty}
    if empty == "left out":
        del entry[name]
    with pytest.raises(ConfigError, match=rf"overrides\.yaml: entry 1.* is without {name}, ") as no:
        _read(tmp_path, entry)
    assert no.value.exit_code == 2


@pytest.mark.parametrize(
    ("change", "text"),
    [
        ({"reason": "\u200b"}, "words that a reader sees"),
        ({"by": "-"}, "words that a reader sees"),
        ({"reason": 7}, "valid string"),
        ({"expires": "2026-02-30"}, "a day, YYYY-MM-DD"),
        ({"expires": "20261224"}, "a day, YYYY-MM-DD"),
        ({"expires": "never"}, "a day, YYYY-MM-DD"),
        ({"gate": "F"}, "'F'"),
        ({"limit": True}, "True"),
        ({"limit": "0.3"}, "0.3"),
        ({"approved": True}, "Extra inputs"),
        ({"criterion": "hold_share"}, "no criterion with a limit there"),
        ({"criterion": "told_share"}, "no criterion with a limit there"),
        ({"gate": "C"}, "no criterion with a limit there"),
        ({"criterion": "confidence"}, "no criterion with a limit there"),
        ({"criterion": "promotion_e_value", "limit": 2.0}, "follows from settings"),
        ({"candidate": "act"}, "nobody who stands for promotion"),
        ({"limit": 0.25}, "above the limit 0.25"),
        ({"limit": 0.1}, "above the limit 0.25"),
        ({"criterion": "nominal_success_lower", "limit": 0.9}, "below the limit 0.7"),
        ({"limit": 0.51}, r"<= 0\.5, because it stands more than it acts"),
        ({"criterion": "nominal_success_lower", "limit": 0.19}, r">= 0\.2, because"),
        ({"criterion": "stub_violations", "limit": 1}, "nobody overrides it"),
    ],
)
def test_what_is_no_exception_to_a_limit_is_refused(tmp_path, change, text):
    with pytest.raises(ConfigError, match=text):
        _read(tmp_path, {**ENTRY, **change})


@pytest.mark.parametrize(
    "text",
    [
        "[]", "overrides: 1", "overrides:", "other: []", "overrides: [1]", "overrides: [",
        "overrides: []\nmore: 1",
        "overrides: [{gate: D, criterion: hold_share_upper, limit: .inf, by: a, reason: b,"
        " expires: '2026-12-24'}]",
        "overrides: [{gate: D, criterion: hold_share_upper, limit: 0.3, by: a, reason: b,"
        " expires: 2026-12-24}]",
    ],
)  # fmt: skip
def test_a_file_of_another_form_is_refused(tmp_path, text):
    (tmp_path / OVERRIDES).write_text(text)
    with pytest.raises(ConfigError, match=OVERRIDES):
        read_overrides(tmp_path, evidence.PARAMS)


def test_a_rehearsal_with_looser_limits_takes_the_exceptions_of_its_checkout(tmp_path):
    params = copy.deepcopy({**evidence.PARAMS, "rehearsal": True})
    evidence.set_limit("gate_d", "hold_share_upper", 0.4)(params)
    assert len(_read(tmp_path, ENTRY, params=params)) == 1
    with pytest.raises(ConfigError, match="above the limit"):
        _read(tmp_path, ENTRY, params={**params, "rehearsal": False})


def test_a_rehearsal_leaves_out_exceptions_to_what_it_does_not_ask(tmp_path):
    params = copy.deepcopy({**evidence.PARAMS, "rehearsal": True})
    owner = next(o for o, own in params["gate_d"]["limits"].items() if "hold_share_upper" in own)
    del params["gate_d"]["limits"][owner]["hold_share_upper"]
    params["gate_d"]["not_applicable"] = {owner: {"hold_share_upper": "too few starts"}}
    other = {**ENTRY, "criterion": "reset_upper", "limit": 0.09}
    assert [entry.criterion for entry in _read(tmp_path, ENTRY, other, params=params)] == [
        "reset_upper"
    ]
    with pytest.raises(ConfigError, match="no criterion with a limit"):
        _read(tmp_path, {**ENTRY, "criterion": "hold_share"}, params=params)


def test_the_looser_of_the_two_limits_counts_in_a_rehearsal():
    ruled = _rule({"limit": 0.03}, _answer("INCONCLUSIVE", 0.05, interval=(0.035, 0.05)))
    assert ruled.answers[0].verdict == "INCONCLUSIVE", "by 0.04, not FAIL by the stricter 0.03"
    assert (ruled.overrides[0].limit, ruled.overrides[0].threshold) == (0.04, 0.04)


def test_what_lacks_beside_the_criteria_lacks_without_the_exception_too():
    for answer in (_answer("PASS", measured=0.01), _answer("FAIL")):
        ruled = _rule({"limit": 0.06}, answer, lacking=["task"])
        assert ruled.verdict == "INCONCLUSIVE"
        assert ruled.overrides[0].without == {"PASS": "INCONCLUSIVE"}.get(
            answer.verdict, answer.verdict
        )


def test_a_limit_is_overridden_once(tmp_path):
    with pytest.raises(ConfigError, match="overridden twice"):
        _read(tmp_path, ENTRY, {**ENTRY, "by": "mo"})
    assert len(_read(tmp_path, ENTRY, {**ENTRY, "candidate": "diffusion"})) == 2


def test_what_is_declared_not_applicable_has_no_limit_to_override(tmp_path):
    params = copy.deepcopy(evidence.PARAMS)
    owner = next(o for o, own in params["gate_d"]["limits"].items() if "hold_share_upper" in own)
    del params["gate_d"]["limits"][owner]["hold_share_upper"]
    params["gate_d"]["not_applicable"] = {owner: {"hold_share_upper": "it never holds"}}
    with pytest.raises(ConfigError, match="no criterion with a limit"):
        _read(tmp_path, ENTRY, params=params)


FLOORED = [bound for bound in BOUNDS if "." not in bound.place and bound.place != "confidence"]


@pytest.mark.parametrize("rehearsal", [False, True])
@pytest.mark.parametrize("bound", FLOORED, ids=lambda b: f"{b.gate}-{b.place}")
def test_no_constant_of_safety_is_overridden_in_a_rehearsal_neither(tmp_path, bound, rehearsal):
    params = {**copy.deepcopy(evidence.PARAMS), "rehearsal": rehearsal}
    section = params.setdefault(f"gate_{bound.gate.lower()}", {})
    section["limits"] = {"safety": {bound.place: [bound.bound, "the floor itself"]}}
    beyond = bound.bound + (0.001 if bound.comparison == "<=" else -0.001)
    entry = {**ENTRY, "gate": bound.gate, "criterion": bound.place, "limit": beyond}
    with pytest.raises(ConfigError, match="stands in the code, and nobody overrides it"):
        _read(tmp_path, entry, params=params)


@pytest.mark.parametrize("gate", SPECS)
def test_how_a_limit_is_held_is_that_of_its_criterion(gate):
    assert {c.id: comparison_of(c.id) for c in SPECS[gate].criteria} == {
        c.id: c.comparison for c in SPECS[gate].criteria
    }


def _answer(verdict, measured=0.05, interval=None, candidate="flow", name="hold_share_upper"):
    return Answer(
        id=name, question="?", owner="safety", candidate=candidate, measured=measured,
        interval=interval, threshold=0.04, comparison="<=", reason="r", verdict=verdict,
        evidence=(), caveat="", counted="",
    )  # fmt: skip


def _rule(entry, *answers, lacking=()):
    limits = Limits(of={"hold_share_upper": Limit(0.04, "r", "safety")})
    own = (Override(**{**ENTRY, **entry}),)
    return rule(
        Exceptions(own), SPECS["D"].criteria, answers, limits, candidates=True, lacking=lacking
    )


@pytest.mark.parametrize(
    ("answer", "limit", "counts"),
    [
        (_answer("FAIL"), 0.05, "PASS"),
        (_answer("FAIL"), 0.049, "FAIL"),
        (_answer("INCONCLUSIVE", interval=(0.03, 0.05)), 0.05, "PASS"),
        (_answer("INCONCLUSIVE", interval=(0.03, 0.05)), 0.045, "INCONCLUSIVE"),
        (_answer("INCONCLUSIVE", measured=None), 0.5, "INCONCLUSIVE"),
        (_answer("PENDING_REVIEW", measured=None), 0.5, "PENDING_REVIEW"),
        (_answer("PENDING_REVIEW"), 0.5, "PENDING_REVIEW"),
        (_answer("PASS", measured=0.01), 0.5, "PASS"),
    ],
)
def test_an_exception_is_another_limit_and_never_evidence(answer, limit, counts):
    other = _answer("FAIL", name="reset_upper")
    ruled = _rule({"limit": limit}, answer, other)
    assert [a.verdict for a in ruled.answers] == [counts, "FAIL"], "of nobody else"
    (entry,) = ruled.overrides
    assert (entry.verdict, entry.instead) == (answer.verdict, counts)
    assert (ruled.verdict, entry.without) == ("FAIL", "FAIL")


def test_an_exception_is_of_one_candidate():
    ruled = _rule({"limit": 0.06}, _answer("FAIL"), _answer("FAIL", candidate="diffusion"))
    assert ruled.candidates == {"flow": "PASS", "diffusion": "FAIL"}
    assert (ruled.verdict, ruled.overrides[0].without) == ("PASS", "FAIL")


def test_an_exception_that_meets_nobody_says_so():
    ruled = _rule({"limit": 0.06}, _answer("PASS", candidate="diffusion"))
    assert (ruled.overrides[0].verdict, ruled.verdict) == (None, "PASS")
    assert said(ruled.overrides[0]).endswith("It was not asked, so that this changes nothing.")


@pytest.mark.parametrize(
    ("entry", "text"),
    [
        ({"candidate": None}, "without a candidate, expected one candidate"),
        ({"criterion": "verdict_reachable"}, "of flow, expected none: the whole gate is asked"),
    ],
)
def test_an_exception_names_a_candidate_where_each_is_asked_and_there_only(entry, text):
    with pytest.raises(ConfigError, match=text):
        _rule(entry, _answer("FAIL"))


def test_without_exceptions_verdicts_are_what_they_were():
    for verdicts in product(("PASS", "FAIL", "INCONCLUSIVE"), repeat=2):
        answers = [_answer(v, candidate=c) for v, c in zip(verdicts, ("flow", None), strict=True)]
        ruled = rule(NOBODY, (), answers, Limits(), candidates=True)
        assert (ruled.answers, ruled.overrides) == (tuple(answers), ())


def test_the_sentence_of_an_exception():
    """Written by hand: it stands in reports, on the desk and on the card word for word."""
    (entry,) = _rule({"limit": 0.06}, _answer("FAIL")).overrides
    assert said(entry) == (
        "OVERRIDDEN at gate D: hold_share_upper of flow is held to <= 0.06 in place of <= 0.04, by "
        "rita until 2026-12-24 (the cell waits for the tray). Without it: hold_share_upper FAIL, "
        "gate D FAIL."
    )
    (entry,) = _rule({"limit": 0.045}, _answer("FAIL")).overrides
    assert "Even so it is FAIL. Without it" in said(entry)
    (entry,) = _rule({"limit": 0.06}, _answer("PASS", measured=0.01)).overrides
    assert said(entry).endswith("It holds without.")


def _overridden(root, *entries, change=TOO_TIGHT):
    """The reports of gates below as they lie there, and Gate D under exceptions."""
    evidence.write_params(root, change)
    (root / OVERRIDES).write_text(yaml.safe_dump({"overrides": list(entries)}))
    report = judge(root, "D")
    write_bytes(root / report_path("D"), report_bytes(report))
    return report


def test_a_gate_that_passes_by_an_exception_says_so_wherever_it_is_read(ladder):
    before = read_report(ladder, "D")[0]
    report = _overridden(ladder, {**ENTRY, "limit": 0.06})
    sentence = said(report.overrides[0])
    assert (report.verdict, report.promoted) == ("PASS", "flow")
    assert report.candidates == {"flow": "PASS", "diffusion": "FAIL"}
    own = {c.candidate: c for c in report.criteria if c.id == "hold_share_upper"}
    assert {name: c.verdict for name, c in own.items()} == {"flow": "FAIL", "diffusion": "FAIL"}
    assert own["flow"].threshold == 0.04, "an abort threshold follows the limit, not the exception"
    assert (report.overrides[0].verdict, report.overrides[0].without) == ("FAIL", "FAIL")
    assert report.caveats[0] == sentence
    assert "OVERRIDDEN: hold_share_upper by rita; without, gate D FAIL." in report.decision
    assert OVERRIDES in report.materials and decided_by(report) is None
    assert overridden_here(own["flow"], report) and not overridden_here(own["diffusion"], report)
    assert own["flow"] not in counting(report) and own["diffusion"] in counting(report)
    reports = {gate: read_report(ladder, gate)[0] for gate in "ABCD"}
    assert caveats_of(reports)[1] == sentence
    first = of_a_ladder(reports.values())[0][0]
    assert (first.kind, first.text) == ("overridden", sentence)
    summary = markdown(report)
    assert "✓ PASS, OVERRIDDEN" in summary.splitlines()[0] and "✕ **OVERRIDDEN at gate D" in summary
    for page in (gate_page(ladder, report), index_page(ladder)):
        assert '<span class="tag FAIL">✕ OVERRIDDEN</span>' in page
        assert '<li class="word FAIL">OVERRIDDEN at gate D' in page and "rita until 2026" in page
    assert "overridden: PASS by ≤ 6 %, by rita until 2026-12-24" in gate_page(ladder, report)
    text = moved_text(moved({"D": before}, {"D": report}))
    assert f"OVERRIDDEN + {sentence}" in text
    assert exceptions_of(ladder, read_params(ladder), "E").below == report.overrides, (
        "the card repeats it"
    )
    hashes = {gate: read_report(ladder, gate)[1] for gate in "ABC"}
    assert verify_report(ladder, "D", upstream=hashes)[0] == report, "on any day, by anybody"


def test_an_exception_beyond_which_it_fails_saves_nobody(ladder):
    report = _overridden(ladder, {**ENTRY, "limit": 0.045})
    assert report.verdict == "FAIL" and report.promoted is None
    assert decided_by(report).id == "hold_share_upper"
    assert OVERRIDDEN in report.decision


def test_reports_below_an_exception_keep_their_bytes(ladder):
    """Else what was trained behind a gate would be trained again for an exception above it."""
    before = report_bytes(judge(ladder, "C"))
    (ladder / OVERRIDES).write_text(yaml.safe_dump({"overrides": [ENTRY]}))
    assert report_bytes(judge(ladder, "C")) == before
    evidence.write_params(ladder)
    assert OVERRIDES not in judge(ladder, "C").materials


def test_every_limit_that_can_be_overridden_can_be_read(tmp_path):
    """Of each limit of a number: one looser by a hair is an exception, or lies beyond a floor."""
    floors = {(b.gate, b.place): b for b in BOUNDS}
    for gate in "ABCD":
        of = read_limits(evidence.PARAMS, gate, SPECS[gate].criteria).of
        for name, limit in of.items():
            if limit.limit is None:
                continue
            side = math.inf if comparison_of(name) == "<=" else -math.inf
            looser = math.nextafter(limit.limit, side)
            entry = {**ENTRY, "gate": gate, "criterion": name, "limit": looser}
            bound = floors.get((gate, name))
            if bound is not None and bound.bound == limit.limit:
                with pytest.raises(ConfigError, match="nobody overrides it"):
                    _read(tmp_path, entry)
            else:
                assert _read(tmp_path, entry)[0].limit == looser
