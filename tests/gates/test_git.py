"""What git says of a checkout: its answer without space, or nothing at all."""

import subprocess

import pytest

from gates.git import git


@pytest.fixture
def checkout(tmp_path):
    """Two commits, the second of which takes a file away."""
    named = ("-c", "user.name=Ada", "-c", "user.email=ada@example.org")

    def run(*words):
        subprocess.run(["git", "-C", str(tmp_path), *named, *words], check=True)

    run("init", "-q")
    (tmp_path / "plan").write_text("one\n")
    run("add", "-A")
    run("commit", "-qm", "one")
    run("rm", "-q", "plan")
    run("commit", "-qm", "two")
    return tmp_path


def test_an_answer_is_given_without_the_space_around_it(checkout):
    assert git(checkout, "log", "--format=%n %s %n") == "two \n\n\n one"


def test_a_command_that_fails_has_no_answer(checkout, capfd):
    assert git(checkout, "show", "HEAD~7") is None
    assert git(checkout / "nowhere", "log") is None
    assert git(checkout, "diff", "--exit-code", "HEAD~1", "HEAD") is None, "though it printed much"
    assert capfd.readouterr() == ("", "")


def test_a_command_that_says_nothing_is_no_failure(checkout):
    assert git(checkout, "diff", "HEAD", "HEAD") == ""


def test_without_git_there_is_no_answer(checkout, monkeypatch, tmp_path_factory):
    monkeypatch.setenv("PATH", str(tmp_path_factory.mktemp("bin")))
    assert git(checkout, "log") is None


def test_bytes_that_are_no_text_are_read_nevertheless(checkout):
    (checkout / "odd").write_bytes(b"\xff\n")
    digest = git(checkout, "hash-object", "-w", "odd")
    assert git(checkout, "cat-file", "-p", digest) == "�"


@pytest.mark.parametrize("way", ["graft", "replace"])
def test_no_file_of_the_checkout_can_hide_a_commit(checkout, way, monkeypatch):
    first, last = git(checkout, "rev-parse", "HEAD~1"), git(checkout, "rev-parse", "HEAD")
    if way == "graft":
        grafts = checkout / ".git" / "info" / "grafts"
        grafts.parent.mkdir(exist_ok=True)
        grafts.write_text(f"{last}\n")
        monkeypatch.setenv("GIT_GRAFT_FILE", str(grafts))
    else:
        alone = git(checkout, "-c", "user.name=a", "-c", "user.email=a@b.example",
                    "commit-tree", "-m", "alone", f"{last}^{{tree}}")  # fmt: skip
        git(checkout, "replace", last, alone)
    hidden = subprocess.run(
        ["git", "-C", str(checkout), "log", "--format=%H"],
        capture_output=True, text=True, check=True,
    ).stdout.split()  # fmt: skip
    assert first not in hidden, "or this would show nothing"
    assert git(checkout, "log", "--format=%H").split() == [last, first]
