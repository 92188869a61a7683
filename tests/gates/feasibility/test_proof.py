"""The independent checker and its mutants: checks that were never left out are undetected."""

import json
import shutil

import evidence
import pytest
from asked import found_in

from gates import engine
from gates.asked_for import CHECKS_ASKED_FOR, NOT_ASKED_OF_EVERY_TASK
from gates.evidence import Evidence, MissingEvidenceError
from gates.feasibility.proof import checked_violations, mutants_undetected
from gates.feasibility.settings import SHADOW, FeasibilitySettings
from gates.proof import judge

ROWS = [evidence.mutant(layer, name) for layer, name in evidence.CHECKS]
LACKING = [f"{row['layer']}.{row['check']}" for row in ROWS].index("geometric.scene_collision")
FIRST = ROWS[LACKING]
REST = ROWS[:LACKING] + ROWS[LACKING + 1 :]
EXCUSED = {**FIRST, "detected": False, "tried": 0, "not_applicable": "no gripper"}


def _undetected(root, rows):
    """What the criterion says of these rows of `mutants.json`."""
    (root / SHADOW).mkdir(parents=True)
    (root / SHADOW / "mutants.json").write_text(json.dumps(rows))
    return mutants_undetected.measure(Evidence(root), FeasibilitySettings.model_construct())


def test_a_check_that_was_never_disabled_is_undetected(ladder):
    evidence.edit_document(ladder, "shadow/mutants.json", lambda rows: rows[1:])
    report = judge(ladder, "C")
    assert report.verdict == "FAIL"
    assert "representation.shape (not tried)" in found_in(report, "mutants_undetected")[0].caveat


@pytest.fixture(scope="module")
def one_ladder(tmp_path_factory, _ladder):
    """A ladder whose mutants are written anew for each row."""
    root = tmp_path_factory.mktemp("mutants") / "ladder"
    shutil.copytree(_ladder, root)
    return root


@pytest.fixture(scope="module")
def _others_once():
    """All other criteria are measured for the first row; nothing of theirs changes."""
    honest, known = engine._answer, {}

    def answer(item, evidence, inputs, limit, name):
        if item.id == "mutants_undetected":
            return honest(item, evidence, inputs, limit, name)
        if (item.id, name) not in known:
            known[item.id, name] = honest(item, evidence, inputs, limit, name)
        return known[item.id, name]

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(engine, "_answer", answer)
        yield


@pytest.mark.usefixtures("_others_once")
@pytest.mark.parametrize("name", CHECKS_ASKED_FOR)
def test_a_mutant_that_nobody_noticed_turns_gate_c_red_by_its_name(name, one_ladder):
    missed = [row | {"detected": f"{row['layer']}.{row['check']}" != name} for row in ROWS]
    evidence.edit_document(one_ladder, "shadow/mutants.json", lambda rows: missed)
    report = judge(one_ladder, "C")
    red = [answer.id for answer in report.criteria if answer.verdict == "FAIL"]
    assert (report.verdict, red) == ("FAIL", ["mutants_undetected"])
    assert f"not detected: {name}" in found_in(report, "mutants_undetected")[0].caveat


@pytest.mark.parametrize("row", range(len(ROWS)))
def test_every_row_counts_under_its_own_layer(row, tmp_path):
    """`expired` of the layers does not stand for `expired` of the executor."""
    found = _undetected(tmp_path, ROWS[:row] + ROWS[row + 1 :])
    assert found.value == 1 and ".".join(evidence.CHECKS[row]) in found.caveat


def test_all_of_them_are_enough(tmp_path):
    assert _undetected(tmp_path, ROWS).value == 0


def test_a_check_that_a_task_has_no_chunk_for_is_named_with_its_reason(tmp_path):
    found = _undetected(tmp_path, [EXCUSED, *REST])
    assert found.value == 0 and "geometric.scene_collision (no gripper)" in found.caveat


@pytest.mark.parametrize("changes", [{"not_applicable": ""}, {"tried": 3}])
def test_no_reason_or_a_tried_fixture_excuses_nothing(changes, tmp_path):
    assert _undetected(tmp_path, [EXCUSED | changes, *REST]).value == 1


@pytest.mark.parametrize("place", [0, 1])
def test_an_excuse_does_not_undo_a_failure_of_the_same_check(place, tmp_path):
    missed = {**FIRST, "detected": False}
    rows = [missed, EXCUSED] if place else [EXCUSED, missed]
    found = _undetected(tmp_path, [*rows, *REST])
    assert found.value == 1 and "not detected: geometric.scene_collision" in found.caveat


def test_a_check_that_one_of_its_rows_missed_is_missed(tmp_path):
    found = _undetected(tmp_path, [{**ROWS[0], "detected": False}, *ROWS])
    assert found.value == 1


@pytest.mark.parametrize(
    "name", [f"{layer}.{check}" for layer, check in evidence.CHECKS if layer != "execution"]
)
def test_only_what_a_task_may_lack_is_excused(name, tmp_path):
    """With every check of the layers excused the mutants said nothing at all, and passed."""
    excuse = {"detected": False, "tried": 0, "not_applicable": "no such thing"}
    rows = [row | excuse if f"{row['layer']}.{row['check']}" == name else row for row in ROWS]
    assert _undetected(tmp_path, rows).value == (name not in NOT_ASKED_OF_EVERY_TASK)


FOLDERS = [("shadow", "a.mcap"), ("stress", "journals/a.mcap")]


def _checked(root, folder, journal, **changes):
    """The finding of one journal, and the journal; and what the gate makes of both."""
    path = root / "artifacts" / folder / journal
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_bytes(b"journal")
    evidence.document(root, f"{folder}/checker.json", {**evidence.checked("a.mcap", 7), **changes})
    pattern = f"artifacts/{folder}/{journal.replace('a.mcap', '*.mcap')}"
    return checked_violations(Evidence(root), f"artifacts/{folder}", pattern)


@pytest.mark.parametrize("where", FOLDERS)
@pytest.mark.parametrize(
    ("proved", "told"),
    [(6, "6 of 7 actions was proved"), (0, "0 of 7 actions was proved"),
     (None, "reproved_actions = None"), (8, "8 proved actions in all, 7 in the journals")],
)  # fmt: skip
def test_an_action_whose_motion_was_not_proved_is_not_proved(where, proved, told, tmp_path):
    assert _checked(tmp_path, *where).value == 0
    with pytest.raises(MissingEvidenceError, match=told):
        _checked(tmp_path, *where, reproved_actions=proved)


@pytest.mark.parametrize(("count", "named"), [
    (2, "b0, b1"), (3, "b0, b1, b2"), (4, "b0, b1, b2 and 1 more"), (6, "b0, b1, b2 and 3 more"),
])  # fmt: skip
def test_three_that_do_not_belong_together_are_named_and_the_others_counted(tmp_path, count, named):
    known = evidence.checked("a.mcap", 7)["journals"]
    journals = {**known, **{f"b{n}": known["a.mcap"] for n in range(count)}}
    with pytest.raises(MissingEvidenceError, match=rf"do not belong together: {named}$"):
        _checked(tmp_path, "shadow", "a.mcap", journals=journals)


@pytest.mark.parametrize("where", FOLDERS)
def test_a_journal_that_nobody_checked_and_a_finding_of_none_are_named(where, tmp_path):
    with pytest.raises(MissingEvidenceError, match=r"do not belong together: a\.mcap$"):
        _checked(tmp_path, *where, journals={}, checked_actions=0, reproved_actions=0)
    none = evidence.checked("a.mcap", 0)["journals"]
    with pytest.raises(MissingEvidenceError, match="7 checked actions in all, 0 in the journals"):
        _checked(tmp_path, *where, journals=none)
    many = {f"{k}.mcap": evidence.checked("a", 0)["journals"]["a"] for k in range(4)}
    with pytest.raises(MissingEvidenceError, match=r"0\.mcap, 1\.mcap, 2\.mcap and 1 more"):
        found = evidence.checked("a.mcap", 7)["journals"]
        _checked(tmp_path, *where, journals=found | many)


@pytest.mark.parametrize("where", FOLDERS)
def test_a_violation_counts_wherever_it_is_written(where, tmp_path):
    found = evidence.checked("a.mcap", 7)["journals"]["a.mcap"]
    own = {key: value for key, value in evidence.VIOLATION.items() if key != "journal"}
    inside = {"a.mcap": found | {"violations": [own, own]}}
    assert _checked(tmp_path, *where, journals=inside).value == 2
    assert _checked(tmp_path, *where, violations=[evidence.VIOLATION]).value == 1


@pytest.mark.parametrize("where", FOLDERS)
def test_one_checked_action_is_some(where, tmp_path):
    one = evidence.checked("a.mcap", 1)
    assert _checked(tmp_path, *where, **one).value == 0


@pytest.mark.parametrize(("count", "more"), [(3, ""), (5, " and 2 more")])
def test_three_that_do_not_belong_together_are_named_and_of_more_the_number(count, more, tmp_path):
    many = {f"{k}.mcap": evidence.checked("a", 0)["journals"]["a"] for k in range(count)}
    own = evidence.checked("a.mcap", 7)["journals"]
    with pytest.raises(MissingEvidenceError) as caught:
        _checked(tmp_path, *FOLDERS[0], journals=own | many)
    assert str(caught.value).endswith(f": 0.mcap, 1.mcap, 2.mcap{more}")
