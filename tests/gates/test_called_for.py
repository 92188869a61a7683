"""A call for a person needs its reason on record; one that was made up is refused."""

import numpy as np
import pytest

from gates.called_for import uncalled_for
from gates.played_again import Recorded, Turn, recorded_rollouts
from gates.rederive_outcomes import rederive_outcomes
from genpolicy.errors import RefusedError
from genpolicy.evidence.admission_context import make_checker
from genpolicy.evidence.stress.matched import matched_starts
from genpolicy.evidence.stress.perturbations import Nominal, RecoveryDrill
from genpolicy.evidence.stress.rollout import Rollout
from genpolicy.evidence.stress.settings import PersonSettings
from genpolicy.evidence.stress.state import Outcome, Setup
from genpolicy.execution.cell import ExecutionSettings
from genpolicy.execution.journal import Journal, write_journal
from genpolicy.tasks.api import load_task
from genpolicy.verification.attended import PlannedPerson, attended_otherwise
from tests.evidence.stress.conftest import (
    EXECUTION,
    FEASIBILITY,
    HORIZONS,
    PARAMS,
    check,
    drive,
    latency,
)

SILENT, HELD = 600_000_000, 200_000_000
"""As planned, ns."""
LATE = EXECUTION.model_copy(update={"late_chunk": {"fallback": ("insert",)}})


def turns(*rows):
    """Turns of recovery in `align`: when, ns, from where, to where, why, and failures."""
    return [Turn(t, old, new, cause, "align", failures) for t, old, new, cause, failures in rows]


def found(*rows, execution=EXECUTION, **told):
    recorded = Recorded({}, turns=turns(*rows), **told)
    return [what for _, what in uncalled_for(recorded, execution)]


BEGINS = (SILENT, "idle", "hold", "silence", 0)
RETREATS = (SILENT + HELD, "hold", "retreat", "hold over", 0)


def failing(count):
    """Attempts of one recovery, each failed at once."""
    rows = [BEGINS]
    for n in range(count):
        t = SILENT + HELD * (n + 1)
        last = "abort" if n == count - 1 else "hold"
        rows += [(t, "hold", "retreat", "", n), (t, "retreat", last, "fallback rejected", n + 1)]
    return rows


def test_what_recovers_for_a_reason_is_in_order():
    assert found(BEGINS, RETREATS) == []
    assert found(*failing(3)) == []
    assert found((0, "idle", "hold", "drill", 0)) == []
    again = (2 * SILENT + HELD, "idle", "hold", "silence", 0)
    assert found(BEGINS, RETREATS, (SILENT + HELD, "retreat", "idle", "recovered", 0), again) == []


@pytest.mark.parametrize(
    ("rows", "told", "said"),
    [
        ([(SILENT - 50_000_000, *BEGINS[1:])], {}, "begins for 'silence'"),
        ([BEGINS], {"commands": [(50_000_000, np.zeros(10))]}, "begins for 'silence'"),
        ([(SILENT, "idle", "hold", "late chunk", 0)], {}, "begins for 'late chunk'"),
        ([(SILENT, "idle", "hold", "overrun of sample", 0)], {}, "begins for 'overrun of"),
        ([(SILENT, "idle", "hold", "a feeling", 0)], {}, "begins for 'a feeling'"),
        ([BEGINS, (SILENT, *RETREATS[1:])], {}, "holds no longer"),
        ([BEGINS, (SILENT + HELD, "hold", "ask_human", "", 0)], {}, "asked behind attempt 1"),
        (failing(2), {}, "gives up in 'retreat' behind 2 failures"),
        ([(0, "hold", "ask_human", "", 0), (HELD, "ask_human", "abort", "", 0)], {}, "gives up"),
    ],
)
def test_what_recovers_for_none_is_found(rows, told, said):
    assert any(said in one for one in found(*rows, **told)), found(*rows, **told)


def test_a_late_answer_and_a_term_are_reasons_where_they_are_planned_to_be():
    late = [Turn(0, "idle", "hold", "late chunk", phase, 0) for phase in ("insert", "align")]
    assert [list(uncalled_for(Recorded({}, turns=[one]), LATE)) == [] for one in late] == \
        [True, False]  # fmt: skip
    term = (50, "idle", "hold", "overrun of sample", 0)
    assert found(term, overruns=[(50, "sample fallback")]) == []
    for other in ((50, "sample cancel_candidate"), (0, "sample fallback"), (50, "encode fallback")):
        assert found(term, overruns=[other]) != []


def test_nobody_plans_a_recovery_and_a_person_is_asked_at_once():
    alone = ExecutionSettings(**PARAMS["execution"] | {"recovery_plans": {"default": []}})
    asks = (SILENT + HELD, "hold", "ask_human", "hold over", 0)
    assert found(BEGINS, asks, execution=alone) == []
    waits = SILENT + HELD + 3_000_000_000
    gives_up = (waits, "ask_human", "abort", "no person answered", 0)
    assert found(BEGINS, asks, gives_up, execution=alone) == []
    assert found(BEGINS, asks, (waits - 50_000_000, *gives_up[1:]), execution=alone) != []


def rolled_out(answers, ticks, **changes):
    """A genuine rollout under a script: nothing that is no number is silent, recovers and calls."""
    task = load_task("tabletop_insertion")
    shared = {
        "task": task, "horizons": HORIZONS, "execution": EXECUTION, "latency": latency(),
        "perturbation": "nominal", "schedule": Nominal(), "root_seed": PARAMS["seed"],
        "checker": make_checker(task, FEASIBILITY, action_period_s=HORIZONS.action_period_s),
        "method": "bc", "checkpoint": "w" * 64, "sampler": "s" * 64,
    }  # fmt: skip
    (start,) = matched_starts(task, root_seed=PARAMS["seed"], count=1)
    epoch = task.calibration_epochs[-1]
    rollout = Rollout(Setup(**shared | changes), start, 0, calibration_epoch=epoch)
    return drive([rollout], answers, ticks=ticks)[0]


def nothing(rollout):
    return np.full((1, HORIZONS.prediction_horizon, 10), np.nan)


def rests(rollout):
    return np.tile(rollout.world.last_action, (1, HORIZONS.prediction_horizon, 1))


@pytest.fixture(scope="module")
def silent():
    rollout = rolled_out(nothing, 1200)
    assert rollout.outcome is Outcome.INTERVENTION
    return rollout


def executed(**changes):
    return ExecutionSettings(**PARAMS["execution"] | {"term_deadlines": []} | changes)


FALLS_BACK = executed(late_chunk={"fallback": list(EXECUTION.force_limit_n)})
ALONE = executed(recovery_plans={"default": []}, human_timeout_s=1.0)
CUT = executed(
    term_deadlines=[
        [name, 0.01, "fallback"] if name == "sample" else [name, most_s, does]
        for name, most_s, does in PARAMS["execution"]["term_deadlines"]
    ]
)


@pytest.mark.parametrize(
    ("changes", "cause", "last"),
    [
        ({"execution": FALLS_BACK, "latency": latency(0.2)}, "late chunk", "ask_human"),
        ({"execution": CUT, "latency": latency(0.12)}, "overrun of sample", "ask_human"),
        ({"execution": executed(primitive_timeout_s=0.1)}, "silence", "abort"),
        ({"execution": ALONE}, "silence", "ask_human"),
        ({"execution": ALONE, "person": PersonSettings(reaction_s=[2.0, 2.0], longest_s=1.0)},
         "silence", "abort"),
        ({"execution": ALONE, "person": PersonSettings(reaction_s=[0.2, 0.4], longest_s=0.1)},
         "silence", "abort"),
        ({"schedule": RecoveryDrill(), "perturbation": "drill"}, "drill", "idle"),
    ],
)  # fmt: skip
def test_every_honest_way_into_recovery_and_to_a_call_has_its_reason(
    changes, cause, last, tmp_path
):
    rollout = rolled_out(rests if cause == "drill" else nothing, 200, **changes)
    path = tmp_path / "j.mcap"
    write_journal(path, [rollout.journal])
    (recorded,) = recorded_rollouts(path).values()
    execution = changes.get("execution", EXECUTION)
    assert list(uncalled_for(recorded, execution)) == []
    assert (recorded.turns[0].cause, recorded.turns[-1].new) == (cause, last)
    person = changes.get("person")
    plan = person and PlannedPerson(person.reaction_s, person.longest_s, PARAMS["seed"])
    assert list(attended_otherwise(path, plan)) == []
    rules = {one.rule for one in check([rollout], tmp_path, execution=execution).violations}
    assert not rules, rules


def params():
    stress = PARAMS["stress"] | {"starts": 1, "episode_limit_s": 60.0, "severities": {}}
    stress |= {"perturbations": {"nominal": {}}}
    return PARAMS | {"stress": stress, "task": {"name": "tabletop_insertion"}}


def test_a_genuine_call_stands_and_one_at_another_tick_is_refused(silent, tmp_path):
    path = tmp_path / "bc__nominal.mcap"
    write_journal(path, [silent.journal])
    rederive_outcomes(params(), [path])
    (recorded,) = recorded_rollouts(path).values()
    assert len(recorded.turns) > 3
    journal = Journal(silent.journal.session, silent.journal.labels)
    for event in silent.journal.events():
        earlier = 100_000_000 if event.kind == "recovery" and event.t > SILENT - 1 else 0
        journal.add(event.kind, event.t - earlier, event.payload)
    write_journal(path, [journal])
    with pytest.raises(RefusedError, match=r"at 0\.500 s is recovery begins for 'silence'"):
        rederive_outcomes(params(), [path])
