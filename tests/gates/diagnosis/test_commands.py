"""`genpolicy diagnose`: what it prints and by which code it ends."""

import json
import subprocess
import sys
from dataclasses import replace
from pathlib import Path

import pytest

from gates.diagnosis.commands import diagnose
from gates.diagnosis.symptoms import SYMPTOMS
from gates.stress.clocks import UNTOLD, Compared
from genpolicy.cli.shell import run_program

ROOT = Path(__file__).parents[3]


@pytest.fixture
def stands(monkeypatch):
    """Reports in place of those that lie below the root, so that nothing is proved again."""

    def on(reports):
        monkeypatch.setattr("gates.diagnosis.reports.read_reports", lambda root: reports)

    return on


def run(capsys, *words):
    code = run_program(diagnose, "genpolicy diagnose", words)
    printed = capsys.readouterr()
    return code, printed.out, printed.err


def test_reports_of_a_tree_are_proved_before_anything_is_said(ladder, capsys):
    code, out, _ = run(capsys, "--root", str(ladder), "--candidate", "flow")
    assert code == 0
    assert out.startswith("Proved now: A PASS, B PASS, C PASS, D PASS.\n")
    assert "Nothing is red: every place was asked, and holds." in out
    assert all(symptom.name in out for symptom in SYMPTOMS)


def test_a_report_that_is_untrue_is_refused_whatever_the_others_say(ladder, capsys):
    (ladder / "artifacts/shadow/stub.parquet").write_bytes(b"other")
    code, out, _ = run(capsys, "--root", str(ladder))
    assert code == 3 and "Gate C cannot be used: " in out


def test_where_nothing_is_judged_it_is_bad_input_and_says_what_builds_it(repo, capsys):
    (repo / "reviewers.yaml").write_text("people: []\n")
    for words in ((), ("--checkpoints",), ("--symptom", "boundary-jump")):
        code, out, _ = run(capsys, "--root", str(repo), *words)
        assert code == 2 and "Proved now: no report." in out
        assert "`dvc repro gate_a`, or `make ladder`" in out


@pytest.mark.parametrize(
    ("words", "said"),
    [(("--symptom", "jump"), "boundary-jump"), (("--candidate", "floww"), "diffusion, flow")],
)
def test_a_wrong_name_is_told_with_the_right_ones(stands, honest, capsys, words, said):
    stands(honest)
    code, out, err = run(capsys, *words)
    assert code == 2 and out == "" and said in err


@pytest.mark.parametrize("symptom", [symptom.name for symptom in SYMPTOMS])
def test_a_symptom_of_which_nothing_speaks_ends_with_0(stands, honest, capsys, symptom):
    stands(honest)
    code, out, _ = run(capsys, "--symptom", symptom, "--candidate", "flow")
    assert code == 0
    assert out.count("Nothing speaks in what could be asked.") == 2
    assert "Do not conclude: " in out
    assert max(map(len, out.splitlines())) <= 100


def test_what_speaks_ends_with_3(stands, honest, capsys):
    from test_walk import turned

    stands(turned(honest, "D.hold_share_upper", "FAIL", "flow"))
    code, out, _ = run(capsys, "--candidate", "flow")
    (walk,) = json.loads(run(capsys, "--candidate", "flow", "--json")[1])["walks"]
    assert walk["ended_at"] == "timing and queue" and not walk["whole"]
    assert code == 3 and "6  timing and queue    RED" in out
    behind = "What lies behind it was not asked: feasibility, contact controller, evaluator."
    assert behind in " ".join(out.split())
    code, out, _ = run(capsys, "--symptom", "boundary-jump", "--candidate", "flow")
    assert code == 3 and "SPEAKS: hold_share_upper: 5 %, required <= 25 %." in out
    assert "Before all: timing and queue (place 6 of 9) is RED." in out
    code, out, _ = run(capsys, "--candidate", "diffusion")
    assert code == 0
    assert run(capsys, "--checkpoints")[0] == 2  # the other candidate holds, and the card waits


def test_everybody_and_every_symptom_can_be_asked_at_once(stands, honest, capsys):
    stands(honest)
    code, out, _ = run(capsys, "--symptom", "all")
    assert code == 3 and "SPEAKS: the wall clock differs" in out  # of diffusion, as it is planted
    for symptom in SYMPTOMS:
        assert f"{symptom.row} · flow" in out and f"{symptom.row} · diffusion" in out


def test_a_walk_that_cannot_be_ended_is_no_pass(stands, honest, capsys):
    from test_walk import without

    stands(without(honest, "D"))
    code, out, _ = run(capsys)
    assert code == 2 and "Nothing is red as far as was asked; the rest waits: no D." in out
    stands(without(honest, "B", "C", "D"))
    assert run(capsys)[1].count("every candidate, in the chapter's order") == 1


def test_checkpoints_are_a_line_each_with_their_owner(stands, honest, capsys):
    stands(honest)
    code, out, _ = run(capsys, "--checkpoints")
    assert code == 2  # the card is drafted and not judged
    assert "timing       controller  PASS           p95 deadline/freshness violated" in out
    assert "safety       safety      NOT JUDGED     learned score owns safety" in out


def test_json_says_the_same(stands, honest, capsys):
    stands(honest)
    document = json.loads(run(capsys, "--json")[1])
    assert document["proved"] == dict.fromkeys("ABCD", "PASS") and set(document["missing"]) == {"E"}
    walks = document["walks"]
    assert all(walk["whole"] and walk["ended_at"] is None for walk in walks)
    assert [walk["candidate"] for walk in walks] == ["diffusion", "flow"]
    assert {stop["state"] for walk in walks for stop in walk["stops"]} == {"in order"}
    document = json.loads(
        run(capsys, "--symptom", "boundary-jump", "--candidate", "flow", "--json")[1]
    )
    (found,) = document["answers"]
    assert (found["found"], found["undecided"], found["answerable"]) == (False, False, True)
    assert found["do_not_conclude"] == "only architecture is wrong"
    assert found["first"]["numbers"][0]["where"].startswith("reports/gate_c.json")
    rows = json.loads(run(capsys, "--checkpoints", "--json")[1])["rows"]
    assert len(rows) == 9 and rows[0]["owner"] == "perception"


def test_help_loads_nothing():
    """In a process of its own: here everything is loaded."""
    asked = (
        "import sys\n"
        "from gates.diagnosis.commands import diagnose\n"
        "from genpolicy.cli.shell import run_program\n"
        "code = run_program(diagnose, 'genpolicy diagnose', ['--help'])\n"
        "heavy = [name for name in ('numpy', 'pandas', 'gates.proof') if name in sys.modules]\n"
        "print(code, heavy, [n for n in sys.modules if n.startswith('gates.diagnosis.')])\n"
    )
    ended = subprocess.run(
        [sys.executable, "-c", asked], capture_output=True, text=True, cwd=ROOT, check=True
    )
    assert ended.stdout.splitlines()[-1] == "0 [] ['gates.diagnosis.commands']", ended.stderr


@pytest.mark.parametrize("other", [("--symptom", "all"), ("--candidate", "flow")])
def test_rows_take_neither_a_symptom_nor_a_candidate(stands, honest, capsys, other):
    stands(honest)
    code, out, err = run(capsys, "--checkpoints", *other)
    assert code == 2 and out == "" and other[0] in err


@pytest.mark.parametrize("verdict", ["INCONCLUSIVE", "PENDING_REVIEW"])
def test_a_symptom_whose_criterion_is_open_ends_as_the_walk_does(stands, honest, capsys, verdict):
    from test_walk import turned

    stands(turned(honest, "D.hold_share_upper", verdict, "flow"))
    code, out, _ = run(capsys, "--symptom", "boundary-jump", "--candidate", "flow")
    assert code == 3 == run(capsys, "--candidate", "flow")[0]
    assert f"Not decided: hold_share_upper is {verdict}, required <= 25 %" in " ".join(out.split())
    assert "Look at what is not decided (normalization and queue age)" in out


def test_one_number_is_no_answer_while_another_gate_is_not_judged(stands, honest, capsys):
    from test_walk import without

    stands(without(honest, "D"))
    code, out, _ = run(capsys, "--symptom", "boundary-jump", "--candidate", "flow")
    assert code == 2 and "PASS" in out and "Not known: no D." in out


def test_a_red_place_before_an_answer_is_no_quiet_end(stands, honest, capsys):
    from test_walk import turned

    stands(turned(honest, "A.data_defects", "FAIL"))
    code, out, _ = run(capsys, "--symptom", "ood-does-not-stop", "--candidate", "flow")
    assert code == 3 and "SPEAKS" not in out and "Before all: data semantics" in out


@pytest.mark.parametrize("words", [(), ("--symptom", "seed-variance"), ("--checkpoints",)])
def test_a_report_that_cannot_be_read_comes_before_what_speaks(stands, honest, capsys, words):
    from test_walk import turned

    of_flow = turned(honest, "D.unmatched_starts", "FAIL", "flow")
    red = turned(of_flow, "D.unmatched_starts", "FAIL", "diffusion")
    for untrue, code in ((0, 3), (1, 3), (2, 2), (3, 3)):
        stands(replace(red, untrue=untrue))
        assert run(capsys, *words)[0] == code


def test_clocks_that_cannot_be_told_apart_are_asked_and_open(stands, honest, capsys, monkeypatch):
    """No place of the walk asks them, so the symptom alone can say it."""
    few = Compared(UNTOLD, "too few episodes", 3)
    monkeypatch.setattr("gates.diagnosis.of_motion.compared", lambda *_: few)
    stands(honest)
    code, out, _ = run(capsys, "--symptom", "simulation-only", "--candidate", "flow")
    assert code == 3 and "Not decided: whether the two clocks agree: too few episodes." in out


def test_of_two_candidates_one_that_waits_leaves_it_unanswered(stands, honest, capsys):
    report = honest.judged["D"]
    criteria = tuple(c for c in report.criteria if c.candidate != "diffusion")
    judged = {**honest.judged, "D": report.model_copy(
        update={"criteria": criteria, "candidates": {"flow": "PASS"}})}  # fmt: skip
    stands(replace(honest, judged=judged))
    words = ("--symptom", "boundary-jump")
    assert run(capsys, *words, "--candidate", "flow")[0] == 0
    code, out, _ = run(capsys, *words)
    assert code == 2 and "diffusion does not stand at gate D" in " ".join(out.split())
