"""All that `genpolicy diagnose` prints of a few worlds stays what was read last.

It says that a number or a sentence moved, and never that it is right: that is shown by causes that
are planted (`test_symptoms.py`) and by the tests beside the modules. After a change that is meant:

    GOLDEN=write python -m pytest -n 0 tests/gates/diagnosis/test_golden_answers.py
"""

import shutil
import sys
from dataclasses import replace
from pathlib import Path

import evidence
import pytest
from causes_planted import FLOW
from test_walk import turned, without
from worlds import border, uneven

from gates.diagnosis.commands import diagnose
from gates.diagnosis.reports import Reports
from gates.evidence import Evidence

sys.path.insert(0, str(Path(__file__).parents[2]))
import held

GOLDEN = Path(__file__).parent / "golden_answers"
RED = ("A.told_share", "B.mode_coverage_lower", "C.admissible_share", "D.hold_share_upper")
OPEN = ("B.outside_modes_upper", "C.stub_stale", "D.recovery_success_lower")


@pytest.fixture
def world(tmp_path, _ladder, honest):
    """Reports as they were judged, above edited evidence and settings."""

    def make(edit=None, params=None) -> Reports:
        root = tmp_path / "world"
        shutil.copytree(_ladder, root)
        if edit:
            edit(root)
        if params:
            evidence.write_params(root, params)
        return Reports(root, honest.judged, honest.missing, 0, Evidence(root))

    return make


@pytest.fixture
def printed(monkeypatch, capsys):
    """Lines that the command prints of some reports, with its exit code."""

    def lines(reports, **options) -> list[str]:
        monkeypatch.setattr("gates.diagnosis.reports.read_reports", lambda root: reports)
        code = diagnose(**options)
        return [*capsys.readouterr().out.splitlines(), f"exit {code}"]

    return lines


def with_verdicts(reports):
    """Of flow some criteria are broken and some open, in every gate."""
    for names, verdict in ((RED, "FAIL"), (OPEN, "INCONCLUSIVE")):
        for name in names:
            answers = reports.judged[name[0]].criteria
            who = next(
                a.candidate for a in answers if (a.id, a.candidate or FLOW) == (name[2:], FLOW)
            )
            reports = turned(reports, name, verdict, who)
    return reports


def waived(params):
    """A criterion and a question are waived, and flow is excepted from matching."""
    params["gate_a"]["limits"]["perception"].pop("calibration_residual_m")
    params["gate_a"]["not_applicable"] = {"perception": {"calibration_residual_m": "no camera"}}
    params["gate_a"]["waived_checks"] = {"perception": {"of_a_camera": "there is none"}}


def nothing_may_be_refused(params):
    """Every held-out candidate has to pass."""
    evidence.set_limit("gate_c", "admissible_share", 1.0)(params)


def test_answers_of_uneven_evidence_are_what_they_were(world, printed):
    reports = world(uneven, nothing_may_be_refused)
    held.hold(GOLDEN / "uneven.json", {
        name: printed(reports, symptom="all", candidate=name) for name in reports.candidates
    })  # fmt: skip


def as_late(reports):
    """In motion the slower half of one candidate's interval ends where that of flow begins."""
    ends = {"diffusion": (0.05, 0.0625), FLOW: (0.0625, 0.075)}
    criteria = tuple(
        c.model_copy(update={"interval": ends[c.candidate]}) if c.id == "latency_p95_s" else c
        for c in reports.judged["D"].criteria
    )
    changed = reports.judged["D"].model_copy(update={"criteria": criteria})
    return replace(reports, judged={**reports.judged, "D": changed})


def test_answers_on_the_border_are_what_they_were(world, printed):
    reports = as_late(world(border, nothing_may_be_refused))
    held.hold(GOLDEN / "border.json", {FLOW: printed(reports, symptom="all", candidate=FLOW)})


def test_answers_of_broken_and_open_criteria_are_what_they_were(world, printed):
    reports = with_verdicts(world(params=waived))
    held.hold(GOLDEN / "broken.json", {
        "walks": printed(reports),
        "checkpoints": printed(reports, checkpoints=True),
        **{kind: printed(reports, symptom=kind, candidate=FLOW) for kind in
           ("diverse-unsuccessful", "between-modes", "boundary-jump", "ood-does-not-stop")},
        "as documents": printed(reports, as_json=True)
        + printed(reports, checkpoints=True, as_json=True)
        + printed(reports, symptom="between-modes", candidate=FLOW, as_json=True),
    })  # fmt: skip


def test_answers_where_gates_are_not_judged_are_what_they_were(world, printed):
    reports = world()
    early, nothing = without(reports, "C", "D"), without(reports, "A", "B", "C", "D")
    held.hold(GOLDEN / "early.json", {
        "walks": printed(early),
        "checkpoints": printed(early, checkpoints=True),
        "symptoms": printed(early, symptom="all", candidate=FLOW),
        "of nothing": printed(nothing),
    })  # fmt: skip


def test_all_that_holds_is_said_to_hold_as_it_was(world, printed):
    reports = world()
    held.hold(GOLDEN / "even.json", {
        "walks": printed(reports),
        "checkpoints": printed(reports, checkpoints=True),
        "symptoms": printed(reports, symptom="all", candidate=FLOW),
    })  # fmt: skip
