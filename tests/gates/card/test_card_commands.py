"""What `card sign`, `card verify` and `gates check --through E` ask beside the chain."""

import subprocess

import pytest
import yaml
from team import AUTHORS, PEOPLE

from gates import proof
from gates.card.commands import card
from gates.commands import gates, verify
from gates.proof import Rung
from gates.rederive import rederive
from gates.report import read_report
from gates.writing import write_gate
from genpolicy.cli.shell import run_program
from genpolicy.errors import RefusedError

PLAN, CODE = "preregistration.yaml", "gates/more.py"
DAY = ("--today", "2026-11-21")


@pytest.fixture
def run(team, capsys):
    """A command on the ladder: exit code, and all that it printed."""

    def run(*args):
        group = gates if args[0] == "check" else card
        code = run_program(group, "genpolicy", [*args, "--root", str(team.root)])
        printed = capsys.readouterr()
        return code, printed.out + printed.err

    return run


@pytest.fixture
def journals(monkeypatch):
    """Journals that say what the tables say; those of this evidence are no journals."""
    asked = []
    monkeypatch.setattr("gates.rederive.rederive", lambda root, gate, **_: asked.append(gate))
    return asked


@pytest.fixture
def commit(team):
    """The ladder as a repository whose plan came before its evidence, all by the author."""

    def git(*args):
        subprocess.run(["git", "-C", str(team.root), *args], check=True, capture_output=True)

    def commit(*paths, author="ada"):
        git("add", "--", *paths)
        named = ("-c", f"user.name={author}", "-c", f"user.email={author}@example.org")
        git(*named, "commit", "-q", "-m", "x")

    git("init", "-q")
    commit(PLAN)
    commit(".")
    return commit


def _sign(team, run, name="rita"):
    file = team.envelope if team.envelope.exists() else team.complete()
    return run("sign", "--card", str(file), "--key", str(team.folder / name), "--reviewer", name)


def test_a_card_is_signed_and_verified_where_all_of_it_holds(team, run, journals, commit):
    for name in PEOPLE:
        code, said = _sign(team, run, name)
        assert code == 0, said
    assert set(journals) == set("ABCDE")
    journals.clear()
    code, said = run("verify", *DAY)
    assert code == 0 and "PASS" in said, said
    assert set(journals) == set("ABCDE")


def test_evidence_without_journals_is_neither_signed_nor_verified(
    team, run, commit, request, monkeypatch
):
    """Synthetic: its tables agree with its lock file, and no journal says what they say."""
    # Its recordings and checkpoints are none either, which gate A would say before gate C is asked.
    for name in ("rederive_ingest", "rederive_audit", "rederive_policies"):
        monkeypatch.setattr(f"gates.rederive.{name}", lambda *_: None)
    real = yaml.safe_load((request.config.rootpath / "params.yaml").read_text())
    params = yaml.safe_load((team.root / "params.yaml").read_text())
    kept = {name: real[name] for name in ("horizons", "execution", "feasibility")}
    (team.root / "params.yaml").write_text(yaml.safe_dump({**params, **kept}))
    commit("params.yaml")
    code, said = _sign(team, run)
    assert code == 2 and "no journal" in said, said
    assert not team.envelope.exists()


@pytest.mark.parametrize("gate", "CD")
def test_evidence_that_its_journals_do_not_say_is_refused(team, run, commit, monkeypatch, gate):
    """As after a forged table and a forged hash in the lock file: the chain itself holds."""

    def differs(root, asked, **_):
        if asked == gate:
            raise RefusedError(
                gate=gate, criterion="rollout", measured="1", limit="0", report="r", action="Stop."
            )

    monkeypatch.setattr("gates.rederive.rederive", differs)
    code, said = _sign(team, run)
    assert code == 3 and f"Gate {gate} refuses: rollout is 1" in said, said
    assert not team.envelope.exists()
    team.sign(team.complete(), PEOPLE)
    code, said = run("verify", *DAY)
    assert code == 3 and f"Gate {gate} refuses: rollout is 1" in said, said


PASSED = [Rung(gate, "n", "PASS", "", "", "r", 0) for gate in "ABCDE"]


@pytest.fixture
def asked(team, run, journals, monkeypatch):
    """What each command says of a ladder that passes, with a card that others have signed."""
    monkeypatch.setattr(proof, "prove_all", lambda root: PASSED)
    # Nobody judged gate E here; what is overridden below it stands in the report of gate D.
    monkeypatch.setattr("gates.printed.read_report", lambda root, _: read_report(root, "D"))
    team.sign(team.complete(), PEOPLE)

    def asked():
        return [run("verify", *DAY), run("check", "--through", "E")]

    return asked


def test_check_through_e_asks_the_history_and_no_gate_below_does(asked, run):
    """Without a repository nobody knows what came first."""
    assert run("check")[0] == 0
    for code, said in asked():
        assert code == 2, said
        assert "the repository is without git history, expected one that says what" in said


def test_a_history_that_holds_lets_pass(asked, commit):
    said = asked()
    assert [code for code, _ in said] == [0, 0], said


def test_a_plan_that_moved_after_the_evidence(asked, run, team, commit):
    """Also where it moved back: what it was held against has been seen by then."""
    written = (team.root / PLAN).read_text()
    for text in (written + "gate_a.more: ['<=', 1]\n", written):
        (team.root / PLAN).write_text(text)
        commit(PLAN)
    for code, said in (*asked(), _sign(team, run, "rita")):
        assert code == 2, said
        assert f"{PLAN}, what gate A judges by is no older than artifacts/audit" in said, said


def test_a_plan_that_is_only_worded_better_is_the_same_plan(asked, team, commit):
    (team.root / PLAN).write_text((team.root / PLAN).read_text() + "# Read again.\n")
    commit(PLAN)
    said = asked()
    assert [code for code, _ in said] == [0, 0], said


@pytest.mark.parametrize("name", ["rita", "sam"])
def test_neither_reviewer_nor_owner_committed_to_the_candidate(asked, run, team, commit, name):
    (team.root / CODE).parent.mkdir()
    (team.root / CODE).write_text("stiffness = 2\n")
    commit(CODE, author=name)
    for code, said in (*asked(), _sign(team, run, name), _sign(team, run, "col")):
        assert code == 2 and f"by {name}, who committed as {name}@example.org" in said, said
    assert list(AUTHORS) == ["ada"]


def test_a_verdict_below_is_said_before_the_history(run, monkeypatch):
    monkeypatch.setattr("gates.printed.read_report", lambda root, _: read_report(root, "D"))
    failed = [*PASSED[:3], Rung("D", "n", "FAIL", "", "", "r", 3), PASSED[4]]
    monkeypatch.setattr(proof, "prove_all", lambda root: failed)
    code, said = run("check", "--through", "E")
    assert code == 3 and "git" not in said


@pytest.mark.parametrize(
    ("group", "typed", "instead"),
    [
        (gates, "sign", "card sign"), (gates, "verify-card", "card verify"),
        (verify, "card", "card verify"), ("gates.commands:sign", None, "card sign"),
    ],
)  # fmt: skip
def test_a_retired_name_says_what_to_type(group, typed, instead, capsys):
    words = [*([typed] if typed else []), "--card", "c.json", "--today", "2027-01-31"]
    assert run_program(group, "genpolicy", words) == 2
    said = capsys.readouterr()
    assert f"no command any more, expected genpolicy {instead}." in said.err and not said.out


def test_signing_goes_on_behind_a_gate_that_was_judged_before(team, run, commit, monkeypatch):
    """Gate E's page shows who has signed: the next signature makes it old, and is no forgery."""
    monkeypatch.setattr("gates.rederive._evidence", lambda root, gate: None)
    write_gate(team.root, "E")
    for name in ("rita", "mo", "pia"):
        code, said = _sign(team, run, name)
        assert code == 0, said
    with pytest.raises(RefusedError, match="gate_e"):
        rederive(team.root, "E")
