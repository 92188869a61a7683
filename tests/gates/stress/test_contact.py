"""A candidate that touched nothing is named, whether or not its force is judged."""

import evidence
import pytest
from editing import cells

from gates.card.card import caveats_of
from gates.proof import judge
from gates.stress.contact import untouched

ROLLOUTS = "stress/rollouts.parquet"


def _of(method):
    return lambda frame: frame["method"] == method


def _waive_force(params):
    gate = params["gate_d"]
    del gate["limits"]["safety"]["force_peak_p95_n"]
    gate.setdefault("not_applicable", {})["safety"] = {"force_peak_p95_n": "nothing is touched"}


def test_who_never_touched_is_said_and_stays_on_the_card_where_force_is_not_judged(ladder):
    assert untouched(judge(ladder, "D").caveats, "flow") == ""
    evidence.write_params(ladder, _waive_force)
    evidence.edit_table(ladder, ROLLOUTS, cells("force_peak_n", 0.0, where=_of("flow")))
    evidence.edit_table(ladder, ROLLOUTS, cells("force_peak_n", 0.0, where=_of("diffusion")))
    report = judge(ladder, "D")
    many = evidence.STARTS * len(evidence.CONDITIONS)
    said = f"no contact in {many:,} of {many:,} rollouts"
    assert untouched(report.caveats, "flow") == untouched(report.caveats, "diffusion") == said
    assert report.verdict == "PASS", "it is known, and no ground to stop"
    kept = report.model_copy(update={"promoted": "flow"})
    assert any(text.startswith(f"flow: {said}") for text in caveats_of({"D": kept}))


def test_force_is_asked_of_who_touched_although_it_was_declared_not_to_matter(ladder):
    def asked():
        return [one for one in judge(ladder, "D").criteria if one.id == "force_peak_p95_n"]

    assert [one.verdict for one in asked()] == ["PASS", "PASS"]
    evidence.write_params(ladder, _waive_force)
    report = judge(ladder, "D")
    assert report.verdict == "INCONCLUSIVE" and report.promoted is None
    evidence.edit_table(ladder, ROLLOUTS, cells("force_peak_n", 0.0, where=_of("flow")))
    (one,) = asked()
    assert (one.candidate, one.verdict, one.threshold) == ("diffusion", "INCONCLUSIVE", None)
    assert one.reason.startswith("declared not applicable, but it touched something in ")
    assert judge(ladder, "D").candidates == {"diffusion": "INCONCLUSIVE", "flow": "PASS"}


def test_a_rehearsal_asks_nothing_of_it_and_says_so(ladder):
    def told():
        return [text for text in judge(ladder, "D").caveats if "no limit of force" in text]

    assert told() == []
    evidence.write_params(ladder, lambda p: _waive_force(p) or p.update(rehearsal=True))
    assert [text.partition(":")[0] for text in told()] == ["diffusion", "flow"]
    assert judge(ladder, "D").verdict == "PASS"
    evidence.edit_table(ladder, ROLLOUTS, cells("force_peak_n", 0.0, where=_of("flow")))
    (text,) = told()
    assert text.startswith("diffusion: touched something in ") and " N, and no limit" in text


def test_one_touch_is_a_touch_and_what_is_missing_is_the_matter_of_the_criteria(ladder):
    def once(frame):
        first = _of("flow")(frame) & (frame["start"] == 0) & (frame["perturbation"] == "nominal")
        return frame.assign(force_peak_n=frame["force_peak_n"].where(~_of("flow")(frame), 0.0)
                            .where(~first, 0.01))  # fmt: skip

    evidence.edit_table(ladder, ROLLOUTS, once)
    assert untouched(judge(ladder, "D").caveats, "flow") == ""
    evidence.edit_table(ladder, ROLLOUTS, lambda f: f.drop(columns="force_peak_n"))
    assert untouched(judge(ladder, "D").caveats, "flow") == ""


@pytest.mark.parametrize(("caveat", "said"), [
    ("flow: no contact in 9 of 9 rollouts, so that", "no contact in 9 of 9 rollouts"),
    ("flow_2: no contact in 9 of 9 rollouts, so that", ""),
    ("it says flow: no contact in 9 of 9 rollouts", ""),
])  # fmt: skip
def test_it_is_read_by_its_name(caveat, said):
    assert untouched(["Simulation.", caveat], "flow") == said
