"""Of several that pass: one if a paired test tells them apart, else either, by a fixed rule."""

import evidence
import pytest
from asked import settings_of
from editing import cells

from gates.card.card import promoted
from gates.claim import IN_SHORT
from gates.engine import Judged
from gates.evidence import Evidence
from gates.proof import judge
from gates.stress import choice
from gates.stress.choice import Comparison, choose, comparisons, pair_alpha, sooner
from gates.stress.pairs import paired_differences
from gates.writing import write_gate
from genpolicy.errors import RefusedError
from genpolicy.statistics.eprocess import paired_e_value

ROLLOUTS, INVOCATIONS = "stress/rollouts.parquet", "stress/invocations.parquet"


def worse(root, method, starts):
    """The method fails on some more starts, in every condition."""
    hit = lambda f: (f["method"] == method) & (f["start"] % 16 == 8) & (f["start"] < starts)  # noqa: E731
    evidence.edit_table(root, ROLLOUTS, cells("success", False, where=hit))
    evidence.edit_table(root, ROLLOUTS, cells("recovered", False, where=hit))


def test_two_that_cannot_be_told_apart_are_either_and_the_sooner_goes_on_the_card(ladder):
    report = judge(ladder, "D")
    assert report.candidates == {"diffusion": "PASS", "flow": "PASS"}
    assert report.decision.startswith(
        f"promote either of diffusion, flow, {IN_SHORT}: no paired test"
    )
    assert "The card is drafted for flow, whose answers come sooner" in report.decision
    assert report.promoted == "flow"


def test_the_rule_is_the_latency_and_not_the_point_of_success(ladder):
    slow = lambda f: (f["method"] == "flow") & (f["invocation"] > 0)  # noqa: E731
    evidence.edit_table(ladder, INVOCATIONS, cells("latency_s", 0.2, where=slow))
    worse(ladder, "diffusion", 16)
    report = judge(ladder, "D")
    assert report.promoted == "diffusion" and "either of diffusion, flow" in report.decision


def test_no_other_number_stands_for_the_latency(ladder):
    """A harder touch is no slower answer, though it is the last number that is measured."""
    for name in evidence.CANDIDATES:
        own = lambda f, name=name: f["method"] == name  # noqa: E731
        evidence.edit_table(
            ladder, ROLLOUTS, cells("force_peak_n", 1.0 if name == "diffusion" else 9.0, where=own)
        )
    assert judge(ladder, "D").promoted == "flow"


def test_one_that_is_shown_to_be_better_is_promoted_alone(ladder):
    params = lambda p: [  # noqa: E731
        entries[name].__setitem__(0, limit)
        for entries in p["gate_d"]["limits"].values()
        for name, limit in (("nominal_success_lower", 0.2), ("stress_success_lower", 0.1),
                            ("recovery_success_lower", 0.2))
        if name in entries
    ]  # fmt: skip
    # A third of the starts, in every phase: of this evidence a third is that of one phase.
    third = lambda f: f["start"] % 3 == f["start"] // 3 % 3  # noqa: E731
    bad = lambda f: (f["method"] == "flow") & third(f)  # noqa: E731
    base = lambda f: f["method"].isin(evidence.COMPARED) & (f["start"] % 5 != 0)  # noqa: E731
    for who in (bad, base):
        for column in ("success", "recovered"):
            evidence.edit_table(ladder, ROLLOUTS, cells(column, False, where=who))
    evidence.write_params(ladder, params)
    report = judge(ladder, "D")
    assert report.candidates == {"diffusion": "PASS", "flow": "PASS"}
    assert (report.decision, report.promoted) == (
        f"promote diffusion, {IN_SHORT}; shown to be worse: flow", "diffusion"
    )  # fmt: skip


def test_one_that_passes_alone_is_compared_with_nobody(ladder):
    bad = lambda f: f["method"] == "flow"  # noqa: E731
    evidence.edit_table(ladder, ROLLOUTS, cells("interventions", 1, where=bad))
    report = judge(ladder, "D")
    assert (report.decision, report.promoted) == (f"promote diffusion, {IN_SHORT}", "diffusion")


def test_every_ordered_pair_is_tested_at_its_share_of_the_family(ladder):
    worse(ladder, "flow", 80)
    reader, settings = Evidence(ladder), settings_of(ladder, "D")
    found = {(c.better, c.other): c for c in comparisons(reader, settings, settings.candidates)}
    assert set(found) == {("diffusion", "flow"), ("flow", "diffusion")}
    for (better, other), one in found.items():
        d = paired_differences(reader, settings, better, other)
        assert one.e_value == paired_e_value(d, margin=0.0, alpha=0.05).e_value
        assert one.gain == pytest.approx(d.mean())
    assert pair_alpha(settings) == settings.family_alpha / 2
    three = settings.model_copy(update={"candidates": ("a", "b", "c")})
    assert pair_alpha(three) == settings.family_alpha / 6
    alone = settings.model_copy(update={"candidates": ("a",)})
    assert pair_alpha(alone) == settings.family_alpha


def test_equal_latency_is_decided_by_the_order_of_registration():
    assert sooner(["b", "a"], {"a": 0.1, "b": 0.1}) == "b"
    assert sooner(["b", "a"], {"a": 0.1}) == "a"


@pytest.mark.parametrize(
    ("share", "decision", "promoted"),
    [(1.0, f"promote diffusion, {IN_SHORT}; shown to be worse: flow", "diffusion"),
     (0.999, "promote either of flow, diffusion", "flow")],
)  # fmt: skip
def test_a_pair_is_told_apart_from_the_evidence_that_is_needed_on(
    ladder, monkeypatch, share, decision, promoted
):
    """Of neither is a latency known, so of both the first that is registered goes on the card."""
    settings = settings_of(ladder, "D").model_copy(update={"candidates": ("flow", "diffusion")})
    values = {"diffusion": share / pair_alpha(settings), "flow": 0.1}
    monkeypatch.setattr(
        choice, "comparisons",
        lambda *_: [Comparison(one, other, values[one], 0.1)
                    for one, other in (("flow", "diffusion"), ("diffusion", "flow"))],
    )  # fmt: skip
    verdicts = {"flow": "PASS", "diffusion": "PASS"}
    found = choose(Judged(Evidence(ladder), settings, (), "PASS", verdicts))
    assert found.promoted == promoted
    assert found.text.startswith(decision)
    said = "(evidence at most 20 to 1 that diffusion is better than flow, where 20 to 1 is needed; "
    assert ("difference +10 points of success)" in found.text) == (promoted == "flow")
    assert promoted != "flow" or said in found.text


@pytest.mark.parametrize(("change", "promoted"), [({}, "flow"), ({"measured": None}, "diffusion")])
def test_the_card_goes_to_the_sooner_whatever_else_was_measured(ladder, change, promoted):
    """Another number of the same candidate, after its latency; and a latency that is not known."""
    latency = [c for c in judge(ladder, "D").criteria if c.id == "latency_p95_s"]
    own = [c.model_copy(update=change if c.candidate == "flow" else {}) for c in latency]
    # The other number would choose the other one: what breaks the tie is the latency alone.
    more = [c.model_copy(update={"id": "other", "measured": float(c.candidate == promoted)})
            for c in own]  # fmt: skip
    whole = [c.model_copy(update={"candidate": None, "measured": 0.0}) for c in own[:1]]
    verdicts = dict.fromkeys(evidence.CANDIDATES, "PASS")
    answers = (*own, *(more if not change else ()), *whole)
    judged = Judged(Evidence(ladder), settings_of(ladder, "D"), answers, "PASS", verdicts)
    assert choose(judged).promoted == promoted


def unmatched(root, *names):
    """Let some of the candidates stand by exception."""

    def change(params):
        for name in names:
            del params["train_generators"]["samplers"][name]
            params["candidates"][name] = f"own/{name}.yaml"
            params["gate_b"]["unmatched"][name] = {
                "owner": "model", "reason": "brought", "expires": "2027-01-31",
            }  # fmt: skip

    evidence.write_params(root, change)
    evidence.record(root)


def test_who_stands_by_exception_is_ranked_with_nobody(ladder):
    """Flow answers sooner, and would be drafted among equals."""
    unmatched(ladder, "flow")
    report = judge(ladder, "D")
    assert report.candidates == {"diffusion": "PASS", "flow": "PASS"}
    assert report.promoted == "diffusion"
    assert report.decision == (
        f"promote diffusion, {IN_SHORT}; also passed, unmatched and so not ranked: flow"
    )
    assert any("flow is unmatched evidence" in text for text in report.caveats)


def test_between_those_that_nobody_may_rank_a_person_chooses(ladder):
    """Also where one answers sooner: that too would be a choice of the tool."""
    unmatched(ladder, "flow", "diffusion")
    report = write_gate(ladder, "D")
    assert (report.verdict, report.promoted) == ("PASS", None)
    assert report.decision.startswith(
        f"promote either of diffusion, flow, {IN_SHORT}, on unmatched evidence: no ranking may "
        "rest on it, so that a person chooses."
    )
    assert "a person chooses" in (ladder / "reports/gate_d.md").read_text()
    with pytest.raises(RefusedError, match=r"take the exceptions of the others out of gate_b\.unm"):
        promoted(report)
