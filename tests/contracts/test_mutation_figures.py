"""Only a test that turned red has noticed a mutant; what was stopped is said apart."""

import json
import signal

import pytest

from benchmarks.mutation.__main__ import show
from benchmarks.mutation.plan import ROOT, modules
from benchmarks.mutation.plan import tests_of as asked_of
from benchmarks.mutation.runner import name_of

CLEAR = {0: "survived", 1: "killed", 2: "killed"}
STOPPED = {
    -signal.SIGXCPU: "stopped (time)",
    -signal.SIGKILL: "stopped (time)",
    -signal.SIGSEGV: "stopped (SIGSEGV)",
    pytest.ExitCode.NO_TESTS_COLLECTED: "stopped (no test)",
}


@pytest.mark.parametrize(("code", "name"), [*CLEAR.items(), *STOPPED.items()])
def test_what_an_exit_code_says(code, name):
    assert name_of(int(code)) == name


def test_a_mutant_that_ran_out_of_time_is_not_counted_as_killed(tmp_path, capsys):
    outcomes = ["killed", "killed", "survived", "stopped (time)", "killed (time)"]
    rows = [
        {"path": "gates/stress/pairs.py", "kind": "core/NumberReplacer", "occurrence": place,
         "inside": "f", "change": f"-{place}\n+{place}0", "outcome": outcome,
         "red": f"FAILED tests/gates/stress/test_{('pairs', 'trial')[place % 2]}.py::test_x"}
        for place, outcome in enumerate(outcomes)
    ]  # fmt: skip
    out = tmp_path / "out.jsonl"
    out.write_text("".join(json.dumps(row) + "\n" for row in rows))
    show(out)
    said = capsys.readouterr().out
    assert "| where | mutants | killed | by the nearest | stopped | survived |" in said
    assert "| `all` | 5 | 2 | 1 | 2 | 1 | 0.400 | 0.053 to 0.853 |" in said
    named = [line for line in said.splitlines() if line.startswith("- ")]
    assert [line.split(":")[0] for line in named] == [
        "- survived", "- stopped (time)", "- stopped (time)",
    ]  # fmt: skip


def test_the_mirror_is_asked_first_and_no_test_twice():
    """pytest drops a file that is named beside its folder, and met mirrors by the alphabet."""
    for path in modules(["gates", "genpolicy/execution", "genpolicy/feasibility"]):
        tests = asked_of(path)
        place = path.removeprefix("genpolicy/").rpartition("/")
        mirror = f"tests/{place[0]}/test_{place[2]}"
        assert len(set(tests)) == len(tests) and all((ROOT / name).is_file() for name in tests)
        assert tests[0] == mirror or not (ROOT / mirror).is_file()
