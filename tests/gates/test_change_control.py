"""Which limits moved behind their evidence, by whom and which way: asked of a small repository."""

import json
import subprocess

import pytest
import yaml

from gates.card.history import MEASURED
from gates.change_control import control_of, control_text
from gates.floor_history import FLOORS
from gates.overrides import OVERRIDES
from gates.run_commands import limits as command

LIMITS = {"fallback_share_upper": 0.2, "nominal_success_lower": 0.5}


def _params(gate_a=None, **changed):
    section = {"safety": {n: [v, "r"] for n, v in {**LIMITS, **changed}.items()}}
    own = {"perception": {"told_share": [gate_a or 0.4, "r"]}}
    document = {
        "gate_a": {"limits": own},
        "gate_d": {"limits": section},
        "train_generators": {"samplers": {"flow": {}}},
    }
    return yaml.safe_dump(document)


def _lock(*stages):
    """A lock file in which these stages wrote evidence of their own."""
    digests = {stage: f"{number:032x}.dir" for number, stage in enumerate(MEASURED)}
    written = {
        stage: {"outs": [{"path": f"artifacts/{stage}", "md5": digests[stage]}]} for stage in stages
    }
    return yaml.safe_dump({"stages": written})


@pytest.fixture
def repo(tmp_path):
    """A repository, and a function that commits files into it."""

    def git(*args):
        done = ["git", "-C", str(tmp_path), *args]
        return subprocess.run(done, check=True, capture_output=True, text=True).stdout.strip()

    def write(**files):
        names = {"params": "params.yaml", "lock": "dvc.lock", "overrides": OVERRIDES}
        for name, text in files.items():
            (tmp_path / names[name]).write_text(text)

    def commit(author="Ada", **files):
        write(**files)
        git("add", "-A")
        named = ("-c", f"user.name={author}", "-c", f"user.email={author.lower()}@example.org")
        git(*named, "commit", "-q", "--allow-empty", "-m", "x")
        return git("rev-parse", "HEAD")

    git("init", "-q", "-b", "main")
    commit.write, commit.git = write, git
    return tmp_path, commit


def _said(root):
    return [(s.kind, s.place, s.before, s.now, s.by, s.after) for s in control_of(root).shifted]


def test_a_limit_before_its_evidence_has_not_moved(repo):
    root, commit = repo
    commit(params=_params())
    commit(params=_params(fallback_share_upper=0.3))
    commit(lock=_lock("stress"))
    assert control_of(root).shifted == ()
    assert control_text(control_of(root)) == "No limit moved after its evidence was there."


@pytest.mark.parametrize(
    ("limit", "kind"),
    [
        ({"fallback_share_upper": 0.3}, "loosened"),
        ({"fallback_share_upper": 0.1}, "tightened"),
        ({"nominal_success_lower": 0.3}, "loosened"),
        ({"nominal_success_lower": 0.6}, "tightened"),
    ],
)
def test_who_moved_it_behind_its_evidence_and_which_way(repo, limit, kind):
    root, commit = repo
    commit(params=_params(), lock=_lock("stress"))
    sha = commit("Eve", params=_params(**limit))
    (name, value), who = next(iter(limit.items())), "Eve <eve@example.org>"
    before = str(LIMITS[name])
    assert _said(root) == [(kind, f"gate_d.{name}", before, str(value), who, ("stress",))]
    (shift,) = control_of(root).shifted
    assert (shift.commit, shift.gate) == (sha, "D")
    line = control_text(control_of(root)).splitlines()[1]
    assert f"{kind:<10} gate_d.{name}: {before} -> {value}, by {who}, {sha[:10]} of 2" in line


def test_one_commit_with_limit_and_evidence_is_no_earlier_than_it(repo):
    root, commit = repo
    commit(params=_params())
    commit(params=_params(fallback_share_upper=0.3), lock=_lock("stress"))
    assert [kind for kind, *_ in _said(root)] == ["loosened"]


def test_a_limit_that_went_and_came_back_shows_twice_the_newest_first(repo):
    root, commit = repo
    commit(params=_params(), lock=_lock("stress"))
    commit("Eve", params=_params(fallback_share_upper=0.3))
    commit("Mo", params=_params())
    assert [(kind, by.split()[0]) for kind, _, _, _, by, _ in _said(root)] == [
        ("tightened", "Mo"),
        ("loosened", "Eve"),
    ]


def test_a_limit_counts_for_evidence_of_its_own_gate_and_of_those_above(repo):
    root, commit = repo
    commit(params=_params(), lock=_lock("audit"))
    commit(params=_params(fallback_share_upper=0.3))
    assert _said(root) == [], "gate D was not measured yet, and A is judged by other limits"
    commit(lock=_lock("audit", "stress"))
    commit(params=_params(gate_a=0.5, fallback_share_upper=0.3))
    assert [(place, after) for _, place, _, _, _, after in _said(root)] == [
        ("gate_a.told_share", ("audit", "stress"))
    ]


def test_evidence_made_again_is_dated_by_itself(repo):
    root, commit = repo
    commit(params=_params(), lock=_lock("stress"))
    commit(params=_params(fallback_share_upper=0.3))
    commit(lock=_lock("stress").replace("0.dir", "f.dir").replace(".dir", "1.dir"))
    assert _said(root) == []


def test_what_is_not_committed_is_named_so(repo):
    root, commit = repo
    commit(params=_params(), lock=_lock("stress"))
    commit.write(params=_params(fallback_share_upper=0.3))
    assert _said(root) == [
        ("loosened", "gate_d.fallback_share_upper", "0.2", "0.3", "", ("stress",))
    ]
    assert ", by not committed; after stress" in control_text(control_of(root))


def test_evidence_that_is_in_no_commit_has_no_date(repo):
    root, commit = repo
    commit(params=_params())
    commit(params=_params(fallback_share_upper=0.3))
    commit.write(lock=_lock("stress"))
    control = control_of(root)
    assert (control.shifted, control.undated) == ((), ("stress",))
    assert "Unknown of stress: its evidence is in no commit" in control_text(control)


@pytest.mark.parametrize("evil", [False, True])
def test_a_merge_moves_only_what_no_parent_had(repo, evil):
    root, commit = repo
    commit(params=_params(), lock=_lock("stress"))
    commit.git("switch", "-q", "-c", "side")
    commit("Eve", params=_params(fallback_share_upper=0.3))
    commit.git("switch", "-q", "main")
    commit("Mo", params=_params(gate_a=0.5))
    named = ("-c", "user.name=Sam", "-c", "user.email=sam@example.org")
    commit.git(*named, "merge", "-q", "--no-ff", "--no-commit", "side")
    limits = {"nominal_success_lower": 0.1} if evil else {}
    commit("Sam", params=_params(gate_a=0.5, fallback_share_upper=0.3, **limits))
    found = {(place, by.split()[0]) for _, place, _, _, by, _ in _said(root)}
    of_sam = {("gate_d.nominal_success_lower", "Sam")} if evil else set()
    eve, mo = ("gate_d.fallback_share_upper", "Eve"), ("gate_a.told_share", "Mo")
    assert found == {eve, mo, *of_sam}


def test_without_a_history_nobody_knows_who(tmp_path):
    (tmp_path / "params.yaml").write_text(_params())
    said = control_text(control_of(tmp_path))
    assert said == "Who moved a limit is unknown: the repository is without git history."


def test_in_a_folder_that_another_repository_ignores_nobody_knows_who(repo):
    root, commit = repo
    commit(lock=_lock("stress"))
    commit.write(params=_params())
    assert control_of(root).unknown == "params.yaml is in no commit"


def test_a_shallow_clone_does_not_say_who(repo, tmp_path_factory):
    root, commit = repo
    commit(params=_params())
    commit(params=_params(fallback_share_upper=0.3), lock=_lock("stress"))
    clone = tmp_path_factory.mktemp("clone") / "shallow"
    commit.git("clone", "-q", "--depth", "1", f"file://{root}", str(clone))
    assert control_of(clone).unknown == "the repository is a shallow clone"


def test_the_same_repository_and_evidence_say_the_same(repo):
    root, commit = repo
    commit(params=_params(), lock=_lock("audit", "stress"))
    commit("Eve", params=_params(gate_a=0.5, fallback_share_upper=0.1))
    assert control_of(root) == control_of(root)
    assert len(control_of(root).shifted) == 2


def test_who_committed_an_exception(repo, capsys):
    root, commit = repo
    entry = {
        "gate": "D", "criterion": "fallback_share_upper", "candidate": "flow", "limit": 0.3,
        "by": "rita", "reason": "r", "expires": "2026-12-24",
    }  # fmt: skip
    text = yaml.safe_dump({"overrides": [entry]})
    commit(params=_params(), overrides=text)
    commit("Mo", overrides=f"# words\n{text}")
    (said,) = control_of(root).overrides
    assert "fallback_share_upper of flow (gate D): 0.3 by rita until 2026-12-24" in said
    assert "committed by Ada <ada@example.org>, " in said, "who brought it, not who wrote beside it"
    later = text.replace("2026-12-24", "2027-12-24")
    commit.write(overrides=later)
    assert "committed by nobody: not committed" in control_of(root).overrides[0]
    assert command(root) == 0
    assert "OVERRIDDEN  overrides.yaml: fallback" in capsys.readouterr().out
    assert command(root, as_json=True) == 0
    assert set(json.loads(capsys.readouterr().out)) == {
        "unknown", "shifted", "undated", "overrides"
    }  # fmt: skip


def test_settings_of_a_commit_that_cannot_be_read_are_none(repo):
    root, commit = repo
    commit(params=_params(), lock=_lock("stress"))
    commit("Eve", params="{")
    commit("Mo", params=_params())
    moved = {(place, by.split()[0]) for _, place, _, _, by, _ in _said(root)}
    assert ("gate_d.fallback_share_upper", "Eve") in moved, "a limit that is gone is loosened"


BOUND = 'Bound("D", "fallback_share_upper", "<=", {}, "why")\n'


def test_a_bound_of_limits_that_moved_behind_the_evidence_is_listed(repo):
    """Whoever loosens the bound makes room for a limit that nobody could have planned."""
    root, commit = repo
    (root / "gates").mkdir()
    (root / FLOORS).write_text(BOUND.format(0.5))
    commit(params=_params(), lock=_lock("stress"))
    assert _said(root) == []
    (root / FLOORS).write_text(BOUND.format(0.9))
    place = f"{FLOORS}: D.fallback_share_upper"
    assert _said(root) == [("loosened", place, "<= 0.5", "<= 0.9", "", ("stress",))]
    sha = commit("Eve")
    who = "Eve <eve@example.org>"
    assert _said(root) == [("loosened", place, "<= 0.5", "<= 0.9", who, ("stress",))]
    assert f"{place}: <= 0.5 -> <= 0.9, by {who}, {sha[:10]}" in control_text(control_of(root))
    commit(lock=_lock("stress").replace(".dir", "1.dir"))
    assert _said(root) == [], "what was measured again was judged by it from the start"
