"""What each command asks, in which order, and what it leaves with: its parts are stand-ins.

The same is asked of whole ladders in `test_commands_of_a_ladder.py` and of signed cards in
`card/test_card_commands.py`; here a command that passes on too little is seen in a moment.
"""

import datetime
import json
from pathlib import Path

import pytest
import typer
from test_differences import REPORT
from test_verdicts import criterion

from gates import commands
from gates.card import commands as card_commands
from gates.commands import gates, sign, verify
from gates.proof import Admission, Rung
from genpolicy.cli.shell import run_program
from genpolicy.errors import BadInputError, IntegrityError

ROOT = Path("somewhere")
STATES = ("PASS", 0), ("FAIL", 3), ("REFUSED", 2), ("REFUSED", 3), ("NOT JUDGED", 3)
HISTORY = IntegrityError(where="the plan", found="late", expected="early", action="Stop.")


def rungs(**states):
    """Every gate; those that are not named pass."""
    return [
        Rung(gate, "n", *(states.get(gate, ("PASS", 0))[:1]), "", "", f"{gate}.json",
             states.get(gate, ("PASS", 0))[1])
        for gate in "ABCDE"
    ]  # fmt: skip


@pytest.fixture
def stand_in(monkeypatch):
    """Put an answer in the place of a part; an error is raised. Returns what was asked."""
    calls = []

    def put(place, answer=None):
        name = place.rpartition(".")[2]

        def part(*args, **named):
            calls.append((name, *args, *named.values()))
            if isinstance(answer, Exception):
                raise answer
            return answer

        monkeypatch.setattr(place, part)

    return put, calls


@pytest.fixture
def proved(stand_in):
    """A ladder in some state, a front page in another, and a history that may not hold."""
    put, calls = stand_in

    def proved(states, *, page=None, history=None):
        put("gates.proof.prove_all", states)
        put("gates.printed.problems_beside", [page] if page else [])
        put("gates.card.history.require_history", history)
        put("gates.printed.print_rungs")
        put("gates.printed.print_cases")
        calls.clear()
        return calls

    return proved


@pytest.mark.parametrize("through", "ABCDE")
@pytest.mark.parametrize(("verdict", "code"), STATES)
@pytest.mark.parametrize("gate", "AC")
def test_what_is_checked_ends_with_the_gate_that_is_named(proved, gate, verdict, code, through):
    states = rungs(**{gate: (verdict, code)})
    calls = proved(states)
    reached = gate <= through
    assert commands.check(through.lower(), ROOT) == (code if reached else 0)
    assert ("print_rungs", states[: "ABCDE".index(through) + 1], False) in calls
    holds = through == "E" and verdict == "PASS"
    assert (("require_history", ROOT) in calls) == holds, "asked where all of it passes, to the end"


def test_what_passes_may_stand_for_any_code(proved):
    proved(rungs(A=("PASS", 3)))
    assert commands.check("D", ROOT) == 0


@pytest.mark.parametrize(("page", "history", "code"), [
    (None, None, 0), (("page", "another page", "p", 3), None, 3),
    (None, HISTORY, HISTORY.exit_code), (("page", "no page", "p", 2), HISTORY, 2),
])  # fmt: skip
@pytest.mark.parametrize("layout", ["text", "json", "junit", "github"])
def test_what_blocks_beside_the_gates_is_said_in_every_layout(
    proved, capsys, page, history, code, layout
):
    calls = proved(rungs(), page=page, history=history)
    assert commands.check("E", ROOT, False, layout) == code
    beside = [(*page[:3], page[3])] if page else []
    if history:
        beside.append(("history", str(history), "preregistration.yaml", history.exit_code))
    assert capsys.readouterr().err == "".join(f"{text}\n" for _, text, *_ in beside)
    printed = [call for call in calls if call[0].startswith("print")]
    if layout in ("text", "json"):
        assert printed == [("print_rungs", rungs(), layout == "json")]
    else:
        assert printed == [("print_cases", ROOT, rungs(), beside, layout)]


def test_the_last_gate_that_must_pass_is_d_unless_another_is_named(proved):
    calls = proved(rungs(E=("NOT JUDGED", 3)))
    assert commands.check(root=ROOT, as_json=True) == 0
    assert calls[-1] == ("print_rungs", rungs()[:4], True)


@pytest.mark.parametrize(("verdict", "code"), STATES)
@pytest.mark.parametrize("page", [set(), {3}, {2}])
def test_verifying_refuses_what_is_untrue_and_no_verdict(proved, stand_in, verdict, code, page):
    states = rungs(C=(verdict, code), E=("NOT JUDGED", 3))
    calls = proved(states)
    put, _ = stand_in
    kept = [rung for rung in states if rung.verdict != "NOT JUDGED"]
    put("gates.rederive.rederived", kept)
    put("gates.printed.pages_code", page)
    codes = page | ({code} if verdict == "REFUSED" else set())
    assert commands.verify_reports(ROOT) == (2 if 2 in codes else 3 if codes else 0)
    assert ("rederived", ROOT, kept) in calls and ("print_rungs", kept, False) in calls


def test_verifying_nothing_is_refused(proved, capsys):
    calls = proved(rungs(**dict.fromkeys("ABCDE", ("NOT JUDGED", 3))))
    assert commands.verify_reports(ROOT) == 3
    assert capsys.readouterr().err == "not built: make ladder\n"
    assert calls == [("prove_all", ROOT)]


@pytest.fixture
def beneath(stand_in):
    """The history, and what journals say."""
    put, calls = stand_in
    put("gates.card.history.require_history")
    put("gates.rederive.rederive")
    return [
        ("require_history", ROOT),
        *(("rederive", ROOT, gate, gate != "E") for gate in "ABCDE"),
    ], calls


def test_nobody_signs_before_chain_history_and_journals_were_asked(stand_in, beneath, capsys):
    put, calls = stand_in
    put("gates.proof.prove_chain", ("reports", "hashes"))
    put("gates.overriders.require_in_force")
    put("gates.card.signing.sign_card", Path("cards/x.json"))
    calls.clear()
    put("gates.card.resuming.go_on")
    calls.clear()
    assert card_commands.sign(Path("c.json"), Path("k.pem"), "rita", ROOT) == 0
    signed = ("sign_card", ROOT, Path("c.json"), Path("k.pem"), "rita")
    before = [("prove_chain", ROOT, "D"), ("require_in_force", ROOT, "reports")]
    assert calls == [*before, *beneath[0], signed, ("go_on", ROOT)]
    said = "Signed x.json as rita. Judge gate E again to see what is missing.\n"
    assert capsys.readouterr().out == said


@pytest.mark.parametrize("verdict", ["PASS", "FAIL", "PENDING_REVIEW", "INCONCLUSIVE"])
@pytest.mark.parametrize("as_json", [False, True])
def test_a_card_is_valid_only_where_all_beneath_it_was_asked(
    stand_in, beneath, capsys, verdict, as_json
):
    put, calls = stand_in
    answers = [
        criterion("FAIL", None, name).model_copy(update={"counted": counted, "caveat": caveat})
        for name, counted, caveat in (("a", "2 of 3", "late"), ("b", "", "late"), ("c", "1", ""))
    ]
    changes = {"verdict": verdict, "criteria": tuple(answers)}
    report = REPORT.model_copy(update=changes)
    put("gates.proof.judge", report)
    assert commands.verify_card(ROOT, "2026-11-21", as_json) == (0 if verdict == "PASS" else 3)
    judged = ("judge", ROOT, "E", datetime.date(2026, 11, 21))
    assert calls == [judged, *(beneath[0] if verdict == "PASS" else [])]
    out = capsys.readouterr().out
    if as_json:
        assert json.loads(out)["verdict"] == verdict and out.startswith('{\n  "schema_version"')
    else:
        rows = [f"  FAIL           {row}" for row in ("a: 2 of 3; late", "b: late", "c: 1")]
        assert out.splitlines() == [f"{verdict}: Go on.", *rows]


def test_without_a_day_a_card_is_judged_for_today(stand_in, beneath):
    put, calls = stand_in
    put("gates.proof.judge", REPORT)
    commands.verify_card(ROOT)
    assert calls[0] == ("judge", ROOT, "E", None)
    for day in ("soon", "2026-13-01", "21.11.2026"):
        with pytest.raises(BadInputError, match=rf"--today is '{day}', expected YYYY-MM-DD"):
            commands.verify_card(ROOT, day)


def test_a_plan_is_the_bytes_of_the_settings(stand_in, tmp_path, capsys):
    put, calls = stand_in
    put("gates.settings.read_params", {"a": 1})
    put("gates.preregistration.plan_bytes", b"plan")
    assert commands.preregister(tmp_path) == 0
    assert (tmp_path / "preregistration.yaml").read_bytes() == b"plan"
    assert calls == [("read_params", tmp_path), ("plan_bytes", {"a": 1})]
    said = "Wrote preregistration.yaml. Commit it before the evidence exists.\n"
    assert capsys.readouterr().out == said


@pytest.mark.parametrize(("decided", "said"), [("x: 2, required <= 1", "x: 2, required <= 1"),
                                               ("", "Go on.")])  # fmt: skip
def test_a_judged_gate_says_what_decided_or_what_follows(stand_in, capsys, decided, said):
    put, calls = stand_in
    put("gates.writing.write_gate", REPORT)
    put("gates.verdicts.decided_text", decided)
    assert commands.judge("a", ROOT) == 0
    assert calls[0] == ("write_gate", ROOT, "A")
    assert capsys.readouterr().out == f"Gate A: PASS. {said}\n"


@pytest.mark.parametrize("limits", [None, Path("params.yaml")])
def test_an_audit_reads_its_limits_before_its_recordings(stand_in, limits):
    put, calls = stand_in
    for place in (
        "beforehand.check_settings",
        "beforehand.check_import",
        "beforehand.check_folder",
    ):
        put(f"genpolicy.cli.{place}")
    put("gates.need.gate.read_cause_limits")
    put("gates.audit.importing.import_recordings", "opened")
    put("gates.audit.command.run_audit", 7)
    path, out = Path("in"), Path("out")
    assert commands.audit(path, out, "mcap", None, "task", limits, 5) == 7
    names = [call[0] for call in calls]
    assert names == [
        "check_settings", "check_import", "check_folder", *["read_cause_limits"] * bool(limits),
        "import_recordings", "run_audit",
    ]  # fmt: skip
    assert calls[0][1:] == (limits, "--limits", "gate_a")
    assert calls[1][1:] == (path, out, "mcap", None) and calls[2][1:] == (
        out,
        "audit.json",
        "audit",
    )
    options = calls[-1][1]
    assert (options.path, options.out, options.format) == (path, out, "mcap")
    assert (options.task, options.limits, options.seed) == ("task", limits, 5)
    assert calls[-1][2] == "opened" and calls[-2][1] == options


def test_a_shadow_runs_with_those_that_gate_b_admits(stand_in):
    put, calls = stand_in
    below = {gate: REPORT.model_copy(update={"gate": gate, "candidates": judged})
             for gate, judged in (("A", {}), ("B", {"flow": "PASS", "act": "FAIL"}))}  # fmt: skip
    put("gates.proof.admit", Admission("shadow", below, {}))
    put("genpolicy.cli.shadow.run_shadow", 1)
    assert commands.shadow("flow", Path("out"), "e1", ROOT) == 1
    assert calls[0] == ("admit", "shadow", ROOT)
    options = calls[1][1]
    assert calls[1][2] == ("flow",)
    assert (options.root, options.out, options.method, options.episode) == (
        ROOT, Path("out"), "flow", "e1"
    )  # fmt: skip


@pytest.mark.parametrize("as_json", [False, True])
@pytest.mark.parametrize("page", [False, True])
def test_a_summary_is_of_what_was_proved_and_blocks_nothing(
    stand_in, tmp_path, capsys, as_json, page
):
    put, calls = stand_in
    states = rungs()
    put("gates.proof.prove_all", states)
    put("gates.overview.overview", ["lines"])
    put("gates.overview.as_text", "the table")
    put("gates.printed.print_rows")
    if page:
        (tmp_path / "reports").mkdir()
        (tmp_path / "reports/index.html").write_text("")
    assert commands.summary(tmp_path, as_json) == 0
    assert calls[:2] == [("prove_all", tmp_path), ("overview", tmp_path, states)]
    told = ("as_text", ["lines"], False, False)  # no terminal, no colour
    assert calls[2:] == [("print_rows", ["lines"]) if as_json else told]
    announced = "Reports: reports/index.html\n" if page else ""
    assert capsys.readouterr().out == ("" if as_json else f"the table\n{announced}")


@pytest.mark.parametrize(("group", "words", "instead"), [
    (sign, ["sign"], "card sign"), (gates, ["sign", "--card", "c"], "card sign"),
    (gates, ["verify-card"], "card verify"), (verify, ["card", "extra"], "card verify"),
])  # fmt: skip
def test_a_retired_name_says_what_to_type(capsys, group, words, instead):
    assert isinstance(group, typer.Typer)
    group_words = words[1:] if group is sign else words
    assert run_program(group, "genpolicy", group_words) == 2
    said = capsys.readouterr().err
    assert (
        f"no command any more, expected genpolicy {instead}. See `genpolicy {instead} --help`"
        in said
    )


@pytest.mark.parametrize("letter", ["", "F", "AB", "gate_", "gate a"])
def test_a_gate_is_one_of_five(letter):
    with pytest.raises(BadInputError, match="expected A, B, C, D or E"):
        commands.check(letter, ROOT)
