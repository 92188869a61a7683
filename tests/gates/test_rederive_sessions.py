"""A journal of another policy, or of starts that nobody planned, proves nothing of this report."""

from pathlib import Path

import pytest
import yaml
from makers import maker, write_policy

from gates.rederive_planner import planner_maker
from gates.rederive_sessions import checkpoint_of, rederive_sessions
from genpolicy.candidates.joining import JoiningSettings
from genpolicy.contract.planner import PLANNER
from genpolicy.errors import BadInputError, RefusedError
from genpolicy.evidence.stress.measured import Measured, rounded
from genpolicy.execution.journal import Journal, write_journal
from genpolicy.seeds import stream
from genpolicy.tasks.api import WorldSettings, load_task

PARAMS = yaml.safe_load((Path(__file__).parents[2] / "params.yaml").read_text())
OTHER = "f" * 64


def _world(start):
    task = load_task("tabletop_insertion")
    state = task.sample_start(stream(PARAMS["seed"], "starts", start))
    return task.make_world(state, settings=WorldSettings(task.calibration_epochs[-1]))


def _scene(start):
    return load_task("tabletop_insertion").scene_poses(_world(start).observe())


def _session(method, start, *, makers=None, scene=None, arm=None):
    labels = {"method": method, "perturbation": "nominal", "start": str(start)}
    journal = Journal(f"{method}/nominal/{start}", labels)
    journal.add("session", 0, {"labels": labels})
    for checkpoint, sampler in [maker(method)] if makers is None else makers:
        journal.add("active", 0, {"checkpoint": checkpoint, "sampler": sampler})
    journal.scene(0.0, _scene(start) if scene is None else scene)
    world = _world(max(0, start))
    Measured(load_task("tabletop_insertion"), world, journal).note(0.0)
    if arm is not None:
        journal.last("state")["q_rad"] = arm
    return journal


@pytest.fixture
def asked(tmp_path):
    """Asks of some sessions, in a workspace in which both policies were trained."""
    for method in ("flow", "bc"):
        write_policy(tmp_path, method)

    def ask(*sessions, gate="D"):
        write_journal(tmp_path / "flow__nominal.mcap", sessions)
        rederive_sessions(tmp_path, gate, PARAMS, [tmp_path / "flow__nominal.mcap"])

    return ask


@pytest.mark.parametrize("gate", ["C", "D"])
def test_sessions_of_the_trained_policies_on_planned_starts_stand(asked, gate):
    asked(_session("flow", 0), _session("flow", 1), _session("bc", 1), gate=gate)


@pytest.mark.parametrize("gate", ["C", "D"])
@pytest.mark.parametrize(
    ("makers", "said"),
    [([maker("bc")], maker("bc")[0]), ([(maker("flow")[0], OTHER)], maker("flow")[0]),
     ([(OTHER, maker("flow")[1])], OTHER), ([], "nobody")],
)  # fmt: skip
def test_sessions_of_other_weights_or_another_sampler_are_refused(asked, gate, makers, said):
    with pytest.raises(RefusedError) as caught:
        asked(_session("flow", 0, makers=makers), gate=gate)
    assert "flow__nominal.mcap: flow/nominal/0: made by" in str(caught.value)
    assert said in str(caught.value)


def test_only_gate_c_changes_the_maker_on_the_way(asked):
    sessions = _session("flow", 0, makers=[maker("flow"), (OTHER, OTHER)])
    asked(sessions, gate="C")
    with pytest.raises(RefusedError, match="made by"):
        asked(sessions, gate="D")


def test_a_policy_that_was_not_trained_made_nothing(asked):
    with pytest.raises(RefusedError, match="made by"):
        asked(_session("cvae", 0, makers=[(OTHER, OTHER)]))


def test_another_start_under_a_planned_number_is_refused(asked):
    with pytest.raises(RefusedError, match="flow/nominal/0: first seen is fixture"):
        asked(_session("flow", 0, scene=_scene(1)))
    moved = {body: (pose[0] + 1e-5, pose[1]) for body, pose in _scene(0).items()}
    with pytest.raises(RefusedError, match="first seen"):
        asked(_session("flow", 0, scene=moved))
    nearly = {body: (pose[0] + 1e-9, pose[1]) for body, pose in _scene(0).items()}
    asked(_session("flow", 0, scene=nearly))
    with pytest.raises(RefusedError, match="first seen is nothing"):
        asked(_session("flow", 0, scene={}))


def test_an_arm_that_began_elsewhere_in_the_planned_scene_is_refused(asked):
    """Nearer to the hole under the hash of a start that everybody shares."""
    arm = rounded(_world(0).q_meas)
    asked(_session("flow", 0, arm=[arm[0] + 5e-5, *arm[1:]]))
    with pytest.raises(RefusedError, match=r"flow/nominal/0: first measured is joints at \["):
        asked(_session("flow", 0, arm=[arm[0] + 2e-4, *arm[1:]]))
    for nothing in ([], arm[:-1]):
        with pytest.raises(RefusedError, match="first measured"):
            asked(_session("flow", 0, arm=nothing))


@pytest.mark.parametrize("start", [-1, PARAMS["stress"]["starts"]])
def test_a_start_that_is_not_in_the_plan_is_refused(asked, start):
    with pytest.raises(RefusedError, match=r"flow/nominal/.*: start is"):
        asked(_session("flow", start, scene=_scene(0)))


def test_a_session_that_does_not_say_what_it_is_is_bad_input(asked):
    unlabelled, unbegun = Journal("one"), Journal("two")
    unlabelled.add("session", 0, {"labels": {"start": "0"}})
    unbegun.add("active", 0, {"checkpoint": OTHER, "sampler": OTHER})
    for journal in (unlabelled, unbegun):
        with pytest.raises(BadInputError):
            asked(journal)


def test_a_candidate_that_was_a_baseline_of_gate_a_too_is_the_one_that_ran(tmp_path):
    """IBC is trained for Gate A by default; named as a candidate it is trained again."""
    folders = [
        tmp_path / "artifacts" / stage / "ibc" / "seed_0"
        for stage in ("train_baselines", "train_generators")
    ]
    for folder in folders:
        folder.mkdir(parents=True)
    (folders[0] / "config.json").write_text("{}")
    assert checkpoint_of(tmp_path, "ibc", 0) == folders[0]
    (folders[1] / "config.json").write_text("{}")
    assert checkpoint_of(tmp_path, "ibc", 0) == folders[1]
    assert checkpoint_of(tmp_path, "flow", 0) is None


def test_a_session_of_the_planner_was_made_by_that_of_the_task_as_it_is_now(asked):
    own = planner_maker(PARAMS, JoiningSettings())
    asked(_session(PLANNER, 0, makers=[own]))
    for other in ((OTHER, own[1]), (own[0], OTHER), maker("flow")):
        with pytest.raises(RefusedError, match="classical_planner/nominal/0: made by"):
            asked(_session(PLANNER, 0, makers=[other]))
