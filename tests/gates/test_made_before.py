"""What is given again is what would be made; whatever could make it another one is seen."""

import evidence
import made_before
import numpy as np
import pytest
import yaml

from gates import engine
from gates.criterion import Measured
from gates.evidence import Evidence
from gates.pages.figures import Plot
from gates.pages.printing import printed_beside
from gates.proof import judge
from gates.report import report_bytes
from gates.reproducibility import gate as gate_b
from gates.reproducibility import timing
from gates.reproducibility.matching import matched_by
from gates.settings import read_params
from gates.stress import gate as stress
from genpolicy.candidates import judged

KNOWN = 1.0


@pytest.fixture
def _made(monkeypatch):
    """Criteria that were measured and figures that were drawn since; as if nobody replaced it."""
    made: list[str] = []
    measure, picture = made_before._answer, made_before._picture[Plot]

    def noted(item, *others):
        made.append(item.id)
        return measure(item, *others)

    def drawn(plot, *others):
        made.append(plot.title)
        return picture(plot, *others)

    monkeypatch.setattr(made_before, "_answer", noted)
    monkeypatch.setitem(made_before._picture, Plot, drawn)
    monkeypatch.setattr(made_before, "_known", {})
    made_before.forget()
    return made


def _fresh(root, gate):
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(engine, "_answer", made_before._answer)
        return judge(root, gate)


def test_the_same_bytes_are_measured_and_drawn_once(ladder, _made):
    report = judge(ladder, "D")
    printed = printed_beside(ladder, report)
    assert len(_made) > len(stress.GATE.criteria)
    _made.clear()
    assert judge(ladder, "D") == report
    assert printed_beside(ladder, report) == printed
    assert _made == []


def test_what_gate_b_says_of_its_rules_is_said_anew_where_a_training_changed(
    ladder, _made, monkeypatch
):
    asked = []

    def noted(*given, **named):
        asked.append(named["candidates"])
        return matched_by(*given, **named)

    def fresh():
        with pytest.MonkeyPatch.context() as patch:
            patch.setattr(gate_b, "matched_by", matched_by)
            patch.setattr(engine, "_answer", made_before._answer)
            return judge(ladder, "B")

    monkeypatch.setattr(made_before, "matched_by", noted)
    made_before.forget()
    report = judge(ladder, "B")
    assert judge(ladder, "B") == report and len(asked) == 1
    table = "train_generators/flow/seed_0/validation.parquet"
    evidence.edit_table(ladder, table, _half_learned)
    changed = judge(ladder, "B")
    assert len(asked) == 2 and any("flow, matched with" in line for line in changed.caveats)
    assert changed.caveats != report.caveats
    assert changed == fresh()


def _half_learned(frame):
    """Its loss falls to half over the last quarter of its training."""
    return frame.assign(loss=np.where(frame["updates"] < frame["updates"].max(), 2.0, 1.0))


def test_what_read_a_file_that_changed_is_measured_and_the_rest_is_as_it_was(ladder, _made):
    judge(ladder, "D")
    _made.clear()
    evidence.edit_table(ladder, "stress/recoveries.parquet", lambda rows: rows.iloc[1:])
    report = judge(ladder, "D")
    asked = {
        one.id for one in report.criteria if "artifacts/stress/recoveries.parquet" in one.evidence
    }
    assert 0 < len(asked) < len(report.criteria)
    assert asked == set(_made)
    assert report_bytes(report) == report_bytes(_fresh(ladder, "D"))


def test_a_file_that_is_gone_or_comes_is_another_one(ladder, _made):
    file = ladder / "artifacts/stress/recoveries.parquet"
    whole, data = judge(ladder, "D"), file.read_bytes()
    file.unlink()
    evidence.record(ladder)
    without = judge(ladder, "D")
    assert without.verdict != whole.verdict
    assert report_bytes(without) == report_bytes(_fresh(ladder, "D"))
    file.write_bytes(data)
    evidence.record(ladder)
    assert judge(ladder, "D") == whole


def test_another_setting_is_another_question(ladder, _made):
    judge(ladder, "D")
    _made.clear()
    params = read_params(ladder)
    (ladder / "params.yaml").write_text(yaml.safe_dump(params | {"confidence": 0.9}))
    asked = {one.id for one in judge(ladder, "D").criteria}
    assert asked == set(_made) and len(asked) > 10


@pytest.mark.parametrize("gate", "ABCD")
def test_a_criterion_reads_nothing_that_it_does_not_name(gate, ladder, tmp_path, monkeypatch):
    """With every other file empty, but for those of trainings, it answers the same."""
    asked = []

    def noted(*given):
        asked.append((given, made_before._answer(*given)))
        return asked[-1][1]

    monkeypatch.setattr(engine, "_answer", noted)
    judge(ladder, gate)
    assert len(asked) > 10
    for number, ((item, whole, *others), answer) in enumerate(asked):
        root = tmp_path / str(number)
        for file in [path for path in (ladder / "artifacts").rglob("*") if path.is_file()]:
            name = file.relative_to(ladder).as_posix()
            (root / name).parent.mkdir(parents=True, exist_ok=True)
            if name in answer.evidence or made_before.TRAINED in name:
                (root / name).hardlink_to(file)
            else:
                (root / name).touch()
        own = Evidence(root, whole.basis)
        assert made_before._answer(item, own, *others) == answer, answer.id


def test_in_the_place_of_a_function_another_one_answers(ladder, monkeypatch):
    """As in any test that replaces what a criterion calls: nothing of before is given."""
    judge(ladder, "C")
    asked = []

    def counted(*given):
        asked.append(given)
        return Measured(0.0)

    monkeypatch.setattr("gates.feasibility.proof.checked_violations", counted)
    before = len(made_before._known)
    judge(ladder, "C")
    assert asked and len(made_before._known) == before
    assert made_before._replaced


def test_a_function_that_no_criterion_calls_is_none(ladder, monkeypatch):
    monkeypatch.setattr("gates.rederive.rederive", lambda root, gate: None)
    monkeypatch.setattr(judged, "load_policy", lambda folder: None)
    assert not made_before._replaced
    monkeypatch.setitem(evidence.PARAMS, "none", None)
    assert made_before._replaced


def _believe(patch):
    patch.setattr(timing, "require_as_timed", lambda *_, **__: None)


def test_what_always_answers_the_same_in_a_place_makes_a_question_of_its_own(
    ladder, _made, monkeypatch
):
    """Asked without it, with it, behind it, with it once more: each time as if freshly made."""

    def judged_again():
        _made.clear()
        report = judge(ladder, "B")
        made = len(_made)
        assert report_bytes(report) == report_bytes(_fresh(ladder, "B"))
        made_before._replaced.clear()  # what `_fresh` put in a place
        return report, made

    evidence.edit_table(
        ladder, "latency/model.parquet", lambda rows: rows.assign(measured_s=9.0, drawn_s=1.0)
    )
    plain, _ = judged_again()
    with monkeypatch.context() as patch:
        _believe(patch)
        assert not made_before._replaced
        believed, made = judged_again()
        assert believed != plain and made > 10
        patch.undo()
        assert judged_again()[0] == plain
    with monkeypatch.context() as patch:
        made_before.forget()
        _believe(patch)
        assert judged_again() == (believed, 0)


def _kept(answer):
    return lambda *_: answer


@pytest.mark.parametrize(
    "function", [lambda *_: KNOWN, lambda *_, at=1.0: at, _kept(1.0), len, None]
)
def test_what_may_answer_otherwise_another_time_is_told_apart_by_nothing(monkeypatch, function):
    assert made_before._code_of_fixed(function) is None
    monkeypatch.setattr(timing, "require_as_timed", function)
    assert made_before._replaced and not made_before._fixed


def test_evidence_of_another_kind_is_measured_each_time(ladder, _made):
    """As tables in memory, which no file tells apart."""

    class Other(Evidence):
        """Read from wherever it likes."""

    item, _, *others = _asked_first(ladder, "D")
    for kind, measured in ((Other, 2), (Evidence, 1)):
        made_before._known.clear()
        _made.clear()
        for _ in range(2):
            made_before.answer(item, kind(ladder), *others)
        assert _made == [item.id] * measured


def _asked_first(root, gate):
    """What the first criterion of a gate is asked with."""
    asked = []

    def noted(*given):
        asked.append(given)
        return made_before._answer(*given)

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(engine, "_answer", noted)
        judge(root, gate)
    made_before.forget()
    return asked[0]
