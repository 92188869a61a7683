"""What came first, and who committed: asked of a small repository."""

import os
import subprocess
from dataclasses import replace

import pytest
import yaml
from team import KEYS

from gates.card.history import (
    MADE,
    MEASURED,
    require_author_of_brought,
    require_history,
    require_makers_known,
    require_registered_first,
    require_said_by_themselves,
)
from gates.card.people import AllowList, Person
from gates.pipeline import RUNGS
from gates.reproducibility.settings import BROUGHT_FOLDER
from genpolicy.errors import IntegrityError
from genpolicy.evidence.documents.brought import BROUGHT, Brought
from genpolicy.integrity.documents import canonical_json

PLAN, LOCK = "preregistration.yaml", "dvc.lock"
EXCEPTION = {
    "gate": "D", "criterion": "hold_share_upper", "candidate": "flow", "limit": 0.3,
    "by": "rita", "reason": "r", "expires": "2026-12-24",
}  # fmt: skip
FILES = {
    "overrides": "overrides.yaml",
    "plan": PLAN,
    "lock": LOCK,
    "params": "params.yaml",
    "code": "genpolicy/code.py",
}


@pytest.fixture
def history(tmp_path):
    root = tmp_path / "repo"
    root.mkdir()

    def git(*args):
        done = ["git", "-C", str(root), *args]
        return subprocess.run(done, check=True, capture_output=True, text=True).stdout.strip()

    def commit(author="ada", **files):
        for name, text in files.items():
            path = root / FILES[name]
            path.parent.mkdir(exist_ok=True)
            path.write_text(text)
        git("add", "-A")
        mail = f"{author}@example.org"
        named = ("-c", f"user.name={author}", "-c", f"user.email={mail}")
        git(*named, "commit", "-q", "--allow-empty", "-m", "x")
        return git("rev-parse", "HEAD")

    def merge(branch, *options):
        named = ("-c", "user.name=ada", "-c", "user.email=ada@example.org")
        git(*named, "merge", "-q", "--no-ff", "-m", "x", *options, branch)

    git("init", "-q", "-b", "main")
    commit.git, commit.merge = git, merge
    return root, commit


def _lock(digest="0", **other):
    """A lock file in which each stage wrote something of its own."""
    digests = {stage: f"{digest:0>4}{number:0>28}.dir" for number, stage in enumerate(MEASURED)}
    digests |= {stage: digest for stage, digest in other.items() if stage in digests}
    stages = {
        stage: {"outs": [{"path": f"artifacts/{stage}", "md5": digests[stage]}]}
        for stage in MEASURED
    }
    return yaml.safe_dump({"stages": stages})


def test_every_stage_that_measures_for_a_gate_is_dated():
    """A new stage is, until somebody says that it makes things and measures nothing."""
    assert set(MEASURED) | set(MADE) == {stage for stages in RUNGS.values() for stage in stages}
    assert {"audit", "reload", "latency", "shadow", "stress"} < set(MEASURED)
    assert "failure_search" in MADE, "no figure of it is held against a limit"
    assert all(set(MEASURED) & set(RUNGS[gate]) for gate in "ABCD")


def test_a_plan_before_the_evidence_is_one(history):
    root, commit = history
    commit(plan="a: 1")
    commit(lock=_lock())
    require_registered_first(root)
    commit(params="later: 1")
    require_registered_first(root)


def test_evidence_made_again_after_the_plan_is_dated_by_itself(history):
    """A rehearsal, or a run under an earlier plan, is not what is judged."""
    root, commit = history
    commit(lock=_lock("old"))
    commit(plan="a: 1")
    commit(lock=_lock("new"))
    require_registered_first(root)


@pytest.mark.parametrize("stage", MEASURED)
def test_one_gates_evidence_before_the_plan_is_enough(history, stage):
    root, commit = history
    commit(lock=_lock("old"))
    commit(plan="a: 1")
    commit(
        lock=_lock(
            "new", **{stage: yaml.safe_load(_lock("old"))["stages"][stage]["outs"][0]["md5"]}
        )
    )
    with pytest.raises(IntegrityError, match=f"no older than artifacts/{stage}, expected"):
        require_registered_first(root)


def test_a_limit_of_a_higher_gate_may_be_planned_until_its_own_evidence_is_there(history):
    """The trial may be planned when it is known what there is to try; not after the trial."""
    root, commit = history
    first = "gate_a.unasked_checks: ['<=', 0]\nstress.starts: ['>=', 90]\n"
    commit(plan=first)
    old = {s: o["outs"][0]["md5"] for s, o in yaml.safe_load(_lock("old"))["stages"].items()}
    commit(lock=_lock("old"))
    commit(plan=first.replace("90", "120"))
    with pytest.raises(
        IntegrityError, match=r"what gate D judges by is no older than .*(wall_clock|stress)"
    ):
        require_registered_first(root)
    commit(lock=_lock("old", stress="f" * 32))
    with pytest.raises(IntegrityError, match="wall_clock"):
        require_registered_first(root)
    commit(lock=_lock("old", stress="f" * 32, wall_clock="f" * 32))
    require_registered_first(root)
    commit(plan=first.replace("0]\nstress", "1]\nstress").replace("90", "120"))
    commit(lock=_lock("old", stress="e" * 32, wall_clock="e" * 32))
    with pytest.raises(IntegrityError, match=r"what gate A judges by is no older than .*audit"):
        require_registered_first(root)
    assert old["audit"] in (root / LOCK).read_text()


@pytest.mark.parametrize("order", ["after", "together", "moved after", "edited", "uncommitted"])
def test_a_plan_that_came_with_or_after_the_evidence_is_none(history, order):
    root, commit = history
    if order == "after":
        commit(lock=_lock())
        commit(plan="a: 1")
    elif order == "together":
        commit(lock=_lock(), plan="a: 1")
    else:
        commit(plan="a: 1")
        if order == "uncommitted":
            (root / LOCK).write_text(_lock())
        else:
            commit(lock=_lock())
        if order == "moved after":
            commit(plan="a: 2")
        elif order == "edited":
            (root / PLAN).write_text("a: 3")
    with pytest.raises(IntegrityError, match="committed"):
        require_registered_first(root)


def test_evidence_seen_before_the_plan_stays_seen(history):
    """Its bytes lay there, went and came back: the plan was written by who had seen them."""
    root, commit = history
    commit(lock=_lock("seen"))
    commit(lock=_lock("other"))
    commit(plan="a: 1")
    commit(lock=_lock("seen"))
    with pytest.raises(IntegrityError, match="no older than artifacts/audit"):
        require_registered_first(root)


@pytest.mark.parametrize("again", [False, True])
def test_evidence_of_a_branch_without_a_plan_is_found_through_the_merge(history, again):
    """Also where the same bytes came to the main branch by themselves, after the plan."""
    root, commit = history
    commit(params="a: 1")
    commit.git("checkout", "-q", "-b", "side")
    commit(lock=_lock())
    commit.git("checkout", "-q", "main")
    commit(plan="a: 1")
    if again:
        commit(lock=_lock())
    commit.merge("side")
    with pytest.raises(IntegrityError, match="no older than artifacts/audit"):
        require_registered_first(root)


def test_evidence_that_came_with_a_merge_came_after_the_plan(history):
    root, commit = history
    commit(plan="a: 1")
    commit.git("checkout", "-q", "-b", "side")
    commit(params="a: 2")
    commit.git("checkout", "-q", "main")
    commit.merge("side", "--no-commit")
    commit(lock=_lock())
    require_registered_first(root)


def test_an_untracked_plan_is_none(history):
    root, commit = history
    commit(lock=_lock())
    (root / PLAN).write_text("a: 1")
    with pytest.raises(IntegrityError, match="not committed"):
        require_registered_first(root)


@pytest.fixture
def people():
    return _people(ada="author", rita="reviewer", mo="model")


def _people(**roles):
    return AllowList(people=tuple(
        Person(id=name, name=name.title(), role=role, public_key="0" * 64,
               emails=(f"{name}@example.org",))
        for name, role in roles.items()
    ))  # fmt: skip


def test_without_git_nothing_came_first_and_nobody_made_it(tmp_path, people):
    for ask in (require_registered_first, lambda root: require_makers_known(root, ["ada"], people)):
        with pytest.raises(IntegrityError, match="the repository is without git history"):
            ask(tmp_path)


def test_where_git_is_not_installed_nothing_came_first(history, monkeypatch):
    root, commit = history
    commit(plan="a: 1")
    monkeypatch.setenv("PATH", str(root))
    with pytest.raises(IntegrityError, match="without git"):
        require_registered_first(root)


def test_a_clone_that_was_cut_off_does_not_know_who_came_first(history, tmp_path, people):
    """Git gives the whole candidate to who committed last, where the history begins."""
    root, commit = history
    commit("mo", params="a: 1", plan="a: 1")
    commit("ada", lock=_lock())
    commit("ada", params="a: 2")
    cut = tmp_path / "cut"
    commit.git("clone", "-q", "--depth", "1", f"file://{root}", str(cut))
    for ask in (require_registered_first, lambda root: require_makers_known(root, ["ada"], people)):
        with pytest.raises(IntegrityError, match="the repository is a shallow clone"):
            ask(cut)


@pytest.mark.parametrize("text", ["stages: {}", "stages: {audit: {}}", "[1]", "stages: [1]"])
def test_a_lock_without_the_evidence_records_none(history, text):
    root, commit = history
    commit(plan="a: 1")
    commit(lock=text)
    with pytest.raises(IntegrityError, match="artifacts/audit is not committed"):
        require_registered_first(root)


def test_a_lock_without_the_evidence_of_one_stage_records_none_of_it(history):
    root, commit = history
    commit(plan="a: 1")
    lock = yaml.safe_load(_lock())
    del lock["stages"]["stress"]
    commit(lock=yaml.safe_dump(lock))
    with pytest.raises(IntegrityError, match="artifacts/stress is not committed"):
        require_registered_first(root)


def test_only_the_evidence_of_a_stage_dates_it(history):
    """Another output of the stage, older than the plan, is no evidence of it."""
    root, commit = history
    other = {"path": "artifacts/other", "md5": "fedcba9876543210.dir"}
    lock = yaml.safe_load(_lock())
    commit(lock=yaml.safe_dump({"stages": {"stress": {"outs": [other]}}}))
    commit(plan="a: 1")
    outs = lock["stages"]["stress"]["outs"]
    lock["stages"]["stress"]["outs"] = [other, *outs, other]
    commit(lock=yaml.safe_dump(lock))
    require_registered_first(root)


def test_authors_alone_made_the_candidate(history, people):
    root, commit = history
    commit("ada", params="a: 1")
    commit("rita", plan="a: 1")
    require_makers_known(root, ["ada"], people)
    for name in ("rita", "mo"):
        before = commit.git("rev-parse", "HEAD")
        commit(name, code=f"by {name}")
        with pytest.raises(IntegrityError, match=f"{name}, who committed as {name}@example.org"):
            require_makers_known(root, ["ada"], people)
        commit.git("reset", "-q", "--hard", before)
    commit("mo", code="by mo")
    require_makers_known(root, ["ada", "mo"], people)  # mo then signs nothing: `dependence`
    for authors, named in ((["mo"], r"\(mo\)"), ([], r"\(none is named\)")):
        with pytest.raises(IntegrityError, match=f"ada, who committed.* alone {named}"):
            require_makers_known(root, authors, people)


def test_who_commits_for_another_or_helps_has_made_it_too(history, people):
    root, commit = history
    commit("ada", params="a: 1")
    before = commit.git("rev-parse", "HEAD")
    by = {name: ("-c", f"user.name={name}", "-c", f"user.email={name}@example.org")
          for name in ("ada", "rita")}  # fmt: skip
    helped = "x\n\nCo-authored-by: Rita <Rita@Example.org>"
    for committer, words in (
        ("rita", ("-m", "x", "--author=ada <ada@example.org>")),
        ("ada", ("-m", helped)),
        ("ada", ("-m", f"{helped}\nCo-authored-by: ada <ada@example.org>")),
    ):
        (root / FILES["code"]).parent.mkdir(exist_ok=True)
        (root / FILES["code"]).write_text("x = 1\n")
        commit.git("add", "-A")
        commit.git(*by[committer], "commit", "-q", *words)
        with pytest.raises(IntegrityError, match=r"rita, who committed as rita@example\.org"):
            require_makers_known(root, ["ada"], people)
        require_makers_known(root, ["ada", "rita"], people)
        commit.git("reset", "-q", "--hard", before)
    commit.git(*by["ada"], "commit", "-q", "--allow-empty", "-m", "x\n\nCo-authored-by: Rita")
    require_makers_known(root, ["ada"], people)  # no file of the candidate is in it
    (root / FILES["code"]).parent.mkdir(exist_ok=True)
    (root / FILES["code"]).write_text("x = 1\n")
    commit.git("add", "-A")
    commit.git(*by["ada"], "commit", "-q", "-m", "x\n\nCo-authored-by: Rita")
    with pytest.raises(IntegrityError, match="the address is empty"):
        require_makers_known(root, ["ada"], people)


def test_what_a_forge_merges_by_a_button_is_made_by_its_author(history, people):
    root, commit = history
    commit("ada", params="a: 1")
    forge = ("-c", "user.name=GitHub", "-c", "user.email=noreply@github.com")
    for author, known in (("ada", True), ("noreply", False)):
        mail = "noreply@github.com" if author == "noreply" else f"{author}@example.org"
        (root / FILES["code"]).parent.mkdir(exist_ok=True)
        (root / FILES["code"]).write_text(f"by {author}\n")
        commit.git("add", "-A")
        commit.git(*forge, "commit", "-q", "-m", "x", f"--author={author} <{mail}>")
        if known:
            require_makers_known(root, ["ada"], people)
        else:
            with pytest.raises(IntegrityError, match=r"noreply@github\.com"):
                require_makers_known(root, ["ada"], people)


def test_a_commit_that_a_graft_hides_is_read(history, people):
    root, commit = history
    first = commit("ada", params="a: 1")
    commit("mo", code="by mo")
    last = commit("ada", code="by ada")
    (root / ".git" / "info").mkdir(exist_ok=True)
    (root / ".git" / "info" / "grafts").write_text(f"{last} {first}\n")
    with pytest.raises(IntegrityError, match="mo, who committed"):
        require_makers_known(root, ["ada"], people)


def test_a_committer_whom_nobody_lists_is_not_known(history, people):
    root, commit = history
    commit("ada", params="a: 1")
    commit("eve", code="by eve")
    commit("ada", code="by ada")
    with pytest.raises(
        IntegrityError, match=r"somebody not on reviewers.yaml, who committed as eve@"
    ):
        require_makers_known(root, ["ada"], people)
    with pytest.raises(IntegrityError, match="somebody not on"):
        require_makers_known(root, ["ada", "eve"], people)


def test_an_address_is_one_however_it_is_capitalised(history, people):
    root, commit = history
    commit("Ada", params="a: 1")
    require_makers_known(root, ["ada"], people)
    commit("MO", code="by mo")
    with pytest.raises(IntegrityError, match="mo, who committed as mo@"):
        require_makers_known(root, ["ada"], people)


def test_whoever_may_sign_has_addresses(history, people):
    """Else one of theirs could stand under the name of an author."""
    root, commit = history
    commit("ada", params="a: 1")
    for nameless in people.people:
        changed = [
            p.model_copy(update={"emails": ()}) if p == nameless else p for p in people.people
        ]
        with pytest.raises(IntegrityError, match=f"{nameless.id} is without addresses"):
            require_makers_known(root, ["ada"], AllowList(people=tuple(changed)))


@pytest.mark.parametrize("name", ["params.yaml", "genpolicy/code.py", "genpolicy/new.py"])
def test_what_is_not_committed_has_no_author(history, people, name):
    root, commit = history
    commit("ada", params="a: 1", code="by ada")
    require_makers_known(root, ["ada"], people)
    (root / name).write_text("by whom?")
    with pytest.raises(IntegrityError, match=f"{name} is not committed as it lies here"):
        require_makers_known(root, ["ada"], people)


def test_a_history_without_the_candidate_does_not_say_who_made_it(history, people):
    root, commit = history
    commit("ada", plan="a: 1")
    with pytest.raises(IntegrityError, match="the candidate is not committed"):
        require_makers_known(root, ["ada"], people)


def test_a_replaced_commit_is_read_as_it_was(history, people):
    root, commit = history
    first = commit("mo", params="a: 1")
    other = commit("ada", params="a: 1", code="x")
    commit.git("replace", first, other)
    with pytest.raises(IntegrityError, match="mo, who committed"):
        require_makers_known(root, ["ada"], people)


def test_both_are_asked_of_the_card_that_lies_here(history):
    """Of the draft's authors, by the allow-list of the repository."""
    root, commit = history
    entries = [
        {"id": n, "name": n, "role": r, "emails": [f"{n}@example.org"],
         "public_key": KEYS[n].public_key().public_bytes_raw().hex()}
        for n, r in {"ada": "author", "mo": "model"}.items()
    ]  # fmt: skip
    (root / "reviewers.yaml").write_text(yaml.safe_dump({"people": entries}))
    commit("ada", plan="a: 1", params="a: 1")
    commit("ada", lock=_lock())
    os.makedirs(root / "artifacts/card")
    (root / "artifacts/card/card.json").write_bytes(canonical_json(CARD))
    require_history(root)
    commit("mo", code="by mo")
    with pytest.raises(IntegrityError, match="mo, who committed"):
        require_history(root)
    commit("ada", plan="a: 2")
    with pytest.raises(IntegrityError, match="no older than"):
        require_history(root)


CARD = {
    "schema_version": 3, "name": "trial", "task": "t", "candidate": "flow",
    "candidate_checkpoint_sha256": "0", "robot_model": "r", "authors": ["ada"], "reports": {},
    "workspace_lower_m": [0.0, 0.0, 0.0], "workspace_upper_m": [1.0, 1.0, 1.0],
    "speed_limit_m_s": 0.1, "force_limit_n": None, "force_limit_reason": "", "spotter": "",
    "stop_path": "", "abort_thresholds": {}, "abort_windows": {}, "rollback": "stop",
    "caveats": [], "reviewer": "", "not_before": "", "expires": "", "nonce": "",
}  # fmt: skip


def test_a_commit_without_an_address_is_by_nobody_who_is_known(history):
    root, commit = history
    commit(code="x = 1\n")
    (root / FILES["code"]).write_text("x = 2\n")
    commit.git("add", "-A")
    named = ("-c", "user.name=ada", "-c", "user.email=ada@example.org")
    commit.git(*named, "commit", "-q", "-m", "x", "--author=Somebody <>")
    people = _people(ada="author")
    with pytest.raises(IntegrityError, match="the address is empty"):
        require_makers_known(root, ["ada"], people)


@pytest.mark.parametrize("broken", ["<<<<<<< HEAD\na: 1\n", "1: 2\n", "[]\n"])
def test_a_plan_that_once_could_not_be_read_is_another_plan_and_no_end(history, broken):
    root, commit = history
    commit(plan=broken)
    commit(plan="a: 1")
    commit(lock=_lock())
    require_registered_first(root)


def test_who_made_a_policy_that_was_brought_is_an_author_of_the_card(history, people):
    """Its maker has no commit here: without this the maker could review it."""
    root, _ = history
    entry = Brought(
        author="Rita@example.org", sha256="a" * 64, files={}, program={}, started_here=True,
        kind="server", stochastic=True,
        dataset="", training_seed=None,
    )  # fmt: skip
    require_author_of_brought(root, "flow", ["ada"], people)  # nobody was brought
    folder = root / BROUGHT_FOLDER
    folder.mkdir(parents=True)
    BROUGHT.write(folder, {"flow": entry})
    require_author_of_brought(root, "diffusion", ["ada"], people)
    require_author_of_brought(root, "flow", ["ada", "rita"], people)
    with pytest.raises(IntegrityError, match=r"by rita, whom its entry names as rita@example\.org"):
        require_author_of_brought(root, "flow", ["ada"], people)
    BROUGHT.write(folder, {"flow": replace(entry, author="who@example.org")})
    with pytest.raises(IntegrityError, match="by somebody not on"):
        require_author_of_brought(root, "flow", ["ada"], people)


def _exceptions(*entries):
    return yaml.safe_dump({"overrides": list(entries)})


RITA = AllowList(
    people=tuple(
        Person(
            id=name,
            name=name,
            role="reviewer",
            public_key="0" * 64,
            emails=(f"{name}@example.org",),
        )
        for name in ("rita", "mo")
    )
)


def test_an_exception_is_committed_by_whom_it_names(history):
    root, commit = history
    require_said_by_themselves(root, RITA)
    commit("ada", overrides=_exceptions())
    require_said_by_themselves(root, RITA)
    commit("rita", overrides=_exceptions(EXCEPTION))
    require_said_by_themselves(root, RITA)
    other = {**EXCEPTION, "by": "mo", "candidate": "diffusion"}
    commit("mo", overrides=_exceptions(other, EXCEPTION))
    require_said_by_themselves(root, RITA)


@pytest.mark.parametrize("author", ["ada", "mo"])
@pytest.mark.parametrize("change", [{}, {"expires": "2027-12-24"}, {"limit": 0.4}])
def test_nobody_overrides_or_renews_in_the_name_of_another(history, author, change):
    root, commit = history
    if change:
        commit("rita", overrides=_exceptions(EXCEPTION))
    commit(author, overrides=_exceptions({**EXCEPTION, **change}))
    text = f"committed by {author}@example.org, expected a commit of rita"
    with pytest.raises(IntegrityError, match=text):
        require_said_by_themselves(root, RITA)


def test_an_exception_that_was_taken_out_is_said_anew(history):
    root, commit = history
    commit("rita", overrides=_exceptions(EXCEPTION))
    commit("rita", overrides=_exceptions())
    commit("ada", overrides=_exceptions(EXCEPTION))
    with pytest.raises(IntegrityError, match="committed by ada"):
        require_said_by_themselves(root, RITA)


def test_an_exception_that_is_not_committed_is_nobodys(history):
    root, commit = history
    commit("rita", overrides=_exceptions(EXCEPTION))
    (root / "overrides.yaml").write_text(_exceptions({**EXCEPTION, "limit": 0.4}))
    with pytest.raises(IntegrityError, match="not committed as it lies here"):
        require_said_by_themselves(root, RITA)
    (root / "overrides.yaml").write_text(_exceptions({**EXCEPTION, "by": "eve"}))
    commit("eve")
    with pytest.raises(IntegrityError, match="a commit of eve"):
        require_said_by_themselves(root, RITA)


@pytest.mark.parametrize("author", ["ada", "rita"])
def test_a_merge_does_not_revive_what_was_withdrawn(history, author):
    """Git leaves the side that `-s ours` threw away out of a file's history."""
    root, commit = history
    commit("rita", overrides=_exceptions(EXCEPTION))
    commit.git("checkout", "-q", "-b", "side")
    commit("rita", overrides=_exceptions())
    commit.git("checkout", "-q", "main")
    named = ("-c", f"user.name={author}", "-c", f"user.email={author}@example.org")
    commit.git(*named, "merge", "-q", "--no-ff", "-m", "x", "-s", "ours", "side")
    if author == "rita":
        require_said_by_themselves(root, RITA)
        return
    with pytest.raises(IntegrityError, match=r"committed by ada@example\.org"):
        require_said_by_themselves(root, RITA)
    commit("ada", params="later")
    with pytest.raises(IntegrityError, match=r"committed by ada@example\.org"):
        require_said_by_themselves(root, RITA)
    commit("rita", overrides=_exceptions({**EXCEPTION, "reason": "again"}))
    require_said_by_themselves(root, RITA)


@pytest.mark.parametrize("on", ["main", "side"])
def test_a_merge_of_what_they_said_is_still_theirs(history, on):
    """Whoever merges a branch, before or after the entry, has withdrawn and said nothing."""
    root, commit = history
    commit("ada", overrides=_exceptions())
    commit.git("checkout", "-q", "-b", "side")
    commit("rita" if on == "side" else "ada", **{
        "overrides" if on == "side" else "params": _exceptions(EXCEPTION)
    })  # fmt: skip
    commit.git("checkout", "-q", "main")
    commit("rita" if on == "main" else "ada", **{
        "overrides" if on == "main" else "params": _exceptions(EXCEPTION)
    })  # fmt: skip
    commit.merge("side")
    require_said_by_themselves(root, RITA)


def test_an_entry_that_only_a_merge_holds_is_by_who_merged(history):
    root, commit = history
    commit("rita", overrides=_exceptions())
    commit.git("checkout", "-q", "-b", "side")
    commit("mo", params="a: 2")
    commit.git("checkout", "-q", "main")
    commit.merge("side", "--no-commit")
    commit("ada", overrides=_exceptions(EXCEPTION))
    with pytest.raises(IntegrityError, match=r"committed by ada@example\.org"):
        require_said_by_themselves(root, RITA)


def test_whom_a_commit_names_as_having_helped_has_said_nothing(history):
    root, commit = history
    commit("ada", overrides=_exceptions(EXCEPTION))
    named = ("-c", "user.name=ada", "-c", "user.email=ada@example.org")
    helped = "x\n\nCo-authored-by: Rita <rita@example.org>"
    commit.git(*named, "commit", "-q", "--amend", "-m", helped)
    with pytest.raises(IntegrityError, match=r"committed by ada@example\.org"):
        require_said_by_themselves(root, RITA)
