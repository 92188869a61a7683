"""An executor that lacks one question is red at Gate C: its own stage, and the gate itself.

What is taken away is taken away in the memory of the process that runs stage `shadow`, since code
that differs on disk is refused before, by the report of Gate A. Of each kind of mutant there is one
here; the names of all are asked of Gate C one at a time (`tests/gates/feasibility/test_proof.py`),
and each is held to code that lacks it beside its own list (`tests/evidence/shadow`).
"""

import subprocess
import sys
from pathlib import Path

import pytest
from ladder_workspace import set_limit

from benchmarks.ladder_truth.planting import committed
from flows.reproduce import stage_environment
from gates.proof import judge
from gates.report import read_report

TABLE = (
    "from genpolicy.execution import checks\nchecks.CHECKS = tuple({row} for r in checks.CHECKS)"
)
RUN = "from stages import shadow\nfrom stages._stage import main\nmain('shadow', shadow.work)\n"


def changed(name: str, change: str) -> str:
    """The table with another row of this name, before anybody has read it."""
    return TABLE.format(row=f"{change} if r.name == {name!r} else r")


LACKING = {
    "a row": (
        "execution.expired",
        changed("expired", "r._replace(holds=lambda m: True)"),
    ),
    "a place": (
        "execution.stopped@stub",
        changed("stopped", "r._replace(places=r.places - {checks.Place.STUB})"),
    ),
    "a reason": (
        "execution.expired@queue",
        changed("expired", "r._replace(reason=checks.DiscardReason.SUPERSEDED)"),
    ),
    "a clause": (
        "execution.after_force_event:was_here",
        "from genpolicy.evidence.shadow import clauses\n"
        "from genpolicy.execution import checks\n"
        "deaf = clauses.CLAUSES['after_force_event:was_here']\n"
        "def holds(m, whole={r.name: r for r in checks.CHECKS}['after_force_event'].holds):\n"
        "    return whole(deaf(m))\n" + changed("after_force_event", "r._replace(holds=holds)"),
    ),
    "a clause of continuity": (
        "execution.continuity:rest",
        "from genpolicy.execution import continuity\n"
        "continuity.rests = lambda context, holds: True",
    ),
    "hearing": (
        "execution.deaf_to_nan_force",
        "from genpolicy.execution import supervisor\n"
        "whole = supervisor._is_borne\n"
        "supervisor._is_borne = lambda force_n, limit_n: (\n"
        "    force_n != force_n or whole(force_n, limit_n))",
    ),
    "a vote": (
        "execution.vote_age",
        "from genpolicy.candidates import votes\n"
        "votes.VOTE_CHECKS = tuple(r._replace(holds=lambda *_: True) if r.name == 'age' else r\n"
        "                          for r in votes.VOTE_CHECKS)",
    ),
    "a check of a layer": (
        "kinematic.workspace",
        "import dataclasses\n"
        "import numpy as np\n"
        "from genpolicy.feasibility import checks\n"
        "def passes(batch, cell):\n"
        "    return checks.Margins({'workspace': np.full(len(batch), np.inf)})\n"
        "checks.CHECKS = tuple(dataclasses.replace(r, measure=passes) if r.name == 'workspace'\n"
        "                      else r for r in checks.CHECKS)",
    ),
}
"""What an executor lacks: the mutant of it, and how it comes to lack it."""


@pytest.mark.long
@pytest.mark.parametrize("kind", LACKING)
def test_what_lacks_a_question_is_red_at_gate_c_by_the_name_of_its_mutant(
    kind: str, copy: Path
) -> None:
    name, lack = LACKING[kind]
    honest = _said(read_report(copy, "C")[0])
    assert name not in honest
    set_limit(copy, "gate_c", "mutants_undetected", 0.0)
    command = [sys.executable, "-c", f"{lack}\n{RUN}"]
    done = subprocess.run(
        command, cwd=copy, env=stage_environment(copy), capture_output=True, text=True, check=False
    )
    assert done.returncode == 0, done.stderr[-2000:]
    committed("shadow")(copy)
    report = judge(copy, "C")
    assert report.verdict == "FAIL"
    assert name in _said(report).partition("not detected: ")[2]


def _said(report) -> str:
    (answer,) = [one for one in report.criteria if one.id == "mutants_undetected"]
    return answer.caveat
