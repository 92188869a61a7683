"""Planted candidates behind the server kind: each is stopped for the reason named beforehand."""

import threading
from dataclasses import replace

import numpy as np
import pytest
from scipy.spatial.transform import Rotation as Turn

from genpolicy.candidates.conformance.check import check, question
from genpolicy.candidates.wire.extension import WORD
from genpolicy.candidates.wire.remote import RemotePolicy
from genpolicy.contract.action import GRIPPER, ROTATION, split_action
from genpolicy.contract.rotation import rotation_from_6d, rotation_to_6d
from genpolicy.robot.kinematics import ArmKinematics
from genpolicy.seeds import counter_noise
from genpolicy.tasks.api import load_task

SERVED = {
    "version": 1, "checkpoint": "a" * 64, "sampler": "b" * 64, "prediction_horizon": 16,
    "seeded": True, "candidates": 64, "counts_evaluations": True,
    "spans": ["preprocess", "encode", "sample"],
}  # fmt: skip
ERROR_M = 0.005


class Clock:
    """Of client and server; goes on by what a server takes, and by nothing else."""

    def __init__(self):
        self.now = 0.0

    def __call__(self):
        return self.now


class Honest:
    """Knows each moment, and answers what was done there, off by a draw of half a centimetre."""

    takes_s = 0.003
    says_s = 0.0029

    def __init__(self, starts, plain=False):
        self.starts = starts
        self.rows = {seen.tobytes(): row for row, seen in enumerate(starts.observations)}
        self.asked = 0
        self.clock = Clock()
        self.metadata = {} if plain else {WORD: dict(SERVED)}
        self.said = {}

    def __call__(self, message):
        self.asked += 1
        said = message.get(WORD, {"invocation": "", "noise": [self.asked], "candidates": 1})
        row = self.rows[message["observation"].tobytes()]
        chunks = np.stack([
            self.chunk(row, (*said["noise"], candidate)) for candidate in range(said["candidates"])
        ])  # fmt: skip
        if WORD not in message:
            return {"actions": chunks[0]}
        self.clock.now += self.takes_s
        answer = {
            "invocation": said["invocation"], "checkpoint": "a" * 64, "sampler": "b" * 64,
            "nfe": 4, "spans_s": dict.fromkeys(SERVED["spans"], self.says_s / 3.0),
        }  # fmt: skip
        return {"actions": chunks, WORD: answer | self.said}

    def chunk(self, row, noise):
        off = np.zeros((16, 10))
        off[:, :3] = ERROR_M * counter_noise(noise, shape=(1, 3))
        return self.starts.chunks[row] + off


class GlobalSeed(Honest):
    """Draws from one generator of the process, whatever the noise is called."""

    def chunk(self, row, noise):
        return super().chunk(row, (self.asked,))


class OtherWeights(Honest):
    """After the first sixty questions it is another one, under the old name."""

    def chunk(self, row, noise):
        return super().chunk(row, ("other" if self.asked > 60 else "first", *noise))


class OtherName(Honest):
    """After ten questions it says so."""

    def __call__(self, message):
        self.said = {"checkpoint": "c" * 64} if self.asked > 10 else {}
        return super().__call__(message)


class RecordedFuture(Honest):
    def chunk(self, row, noise):
        return self.starts.chunks[row]


class IgnoresObservation(Honest):
    def chunk(self, row, noise):
        return super().chunk(0, noise)


class Millimetres(Honest):
    def chunk(self, row, noise):
        return super().chunk(row, noise) * np.array([1e3] * 3 + [1.0] * 7)


class Mirrored(Honest):
    def chunk(self, row, noise):
        return super().chunk(row, noise) * np.array([1.0, -1.0, *[1.0] * 8])


class Spread(Honest):
    """Another standard deviation about the mean of the recordings than it was trained with."""

    factor = 10.0

    def chunk(self, row, noise):
        mean = self.starts.chunks[..., :3].mean(axis=(0, 1))
        chunk = super().chunk(row, noise)
        chunk[:, :3] = mean + self.factor * (chunk[:, :3] - mean)
        return chunk


class Narrow(Spread):
    factor = 0.1


class ClosedGripper(Honest):
    def chunk(self, row, noise):
        chunk = super().chunk(row, noise)
        chunk[:, GRIPPER] = 0.0
        return chunk


class OtherOrigin(Honest):
    """Measures places from a point that lies five centimetres aside."""

    def chunk(self, row, noise):
        return super().chunk(row, noise) + np.array([0.0, 0.05, *[0.0] * 8])


class Turned(Honest):
    """Its tool is mounted twenty degrees off."""

    def chunk(self, row, noise):
        chunk = super().chunk(row, noise)
        turn = Turn.from_euler("z", 20, degrees=True).as_matrix()
        chunk[:, ROTATION] = rotation_to_6d(rotation_from_6d(chunk[:, ROTATION]) @ turn)
        return chunk


class Exchanged(Honest):
    def chunk(self, row, noise):
        return super().chunk(row, noise)[:, [1, 0, *range(2, 10)]]


class OtherWay(Honest):
    """Goes to the other side of where the robot stands than was done: another mode."""

    def chunk(self, row, noise):
        chunk = super().chunk(row, noise)
        side = self.starts.measured[row, 1]
        chunk[:, 1] = side - (chunk[:, 1] - side)
        return chunk


class EitherWay(Honest):
    """Begins where the robot stands and goes left or right of there, by chance."""

    mirrored = 1.0

    def chunk(self, row, noise):
        chunk = super().chunk(row, noise)
        side = np.sign(counter_noise(("side", *noise), shape=(1,)))
        chunk[:, 1] = self.starts.measured[row, 1] + side * np.linspace(0.0, 0.3, 16)
        chunk[:, 1] *= self.mirrored
        return chunk


class MirroredEitherWay(EitherWay):
    """Ways to both sides look the same in a mirror; where they begin does not."""

    mirrored = -1.0


class NoisyGripper(Honest):
    def chunk(self, row, noise):
        chunk = super().chunk(row, noise)
        chunk[:, GRIPPER] += 0.005 * counter_noise(("gripper", *noise), shape=(1,))
        return chunk


class NotANumber(Honest):
    def chunk(self, row, noise):
        return super().chunk(row, noise) + (np.nan if row == 3 else 0.0)


class Fails(Honest):
    at = 5

    def __call__(self, message):
        if self.asked == self.at:
            self.asked += 1
            raise MemoryError("CUDA out of memory")
        return super().__call__(message)


class Slow(Honest):
    takes_s = 0.02
    says_s = 0.019


class Flatters(Honest):
    """Half a second, of which it tells a millisecond."""

    takes_s = 0.5
    says_s = 0.001


class Boasts(Honest):
    """Says a minute for what takes a second, at one moment."""

    @property
    def says_s(self):
        return 60.0 if self.asked == 5 else 0.0029


class CountsAnew(Honest):
    """Counts what it was asked, and not how often its network ran."""

    def __call__(self, message):
        self.said = {"nfe": self.asked + 1}
        return super().__call__(message)


class NeverInTime(Honest):
    """The seventh answer comes when nobody waits any more."""

    def __init__(self, starts):
        super().__init__(starts)
        self.over = threading.Event()

    def __call__(self, message):
        if self.asked == 6:
            self.asked += 1
            self.over.wait(60)
        return super().__call__(message)


class TurnedQuaternion(Honest):
    """Says w first where its entry says it comes last."""

    def chunk(self, row, noise):
        chunk = super().chunk(row, noise)
        quaternion = Turn.from_matrix(rotation_from_6d(chunk[:, 3:9])).as_quat()
        return np.concatenate([chunk[:, :3], np.roll(quaternion, 1, axis=1), chunk[:, 9:]], axis=1)


QUATERNION = {
    "frame": "robot_base", "motion": "absolute", "position": {"columns": [0, 1, 2], "unit": "m"},
    "rotation": {"columns": [3, 4, 5, 6], "form": "quaternion_xyzw"},
    "gripper": {"column": 7, "open": 1.0, "open_m": 1.0},
}  # fmt: skip


class InJoints(Honest):
    """Says where its joints shall be; in degrees where its entry says rad, if it is wrong."""

    wrong = 1.0

    def __init__(self, *args, **fields):
        super().__init__(*args, **fields)
        self.arm = ArmKinematics(load_task("tabletop_insertion").scene_path)
        self.posture = np.array(load_task("tabletop_insertion").posture_rad)

    def chunk(self, row, noise):
        chunk = super().chunk(row, noise)
        place, turned, opened = split_action(chunk)
        seed = np.tile(self.posture, (len(chunk), 1))
        solved = self.arm.solve_with_restarts(place, turned, q_seed_rad=seed)
        assert solved.converged.all()
        return np.concatenate([self.wrong * solved.q_rad, opened[:, None]], axis=1)


class InDegrees(InJoints):
    wrong = 180.0 / np.pi


JOINTS = {
    "motion": "absolute", "joints": {"columns": list(range(7)), "unit": "rad"},
    "gripper": {"column": 7, "open": 1.0, "open_m": 1.0},
}  # fmt: skip


@pytest.fixture
def checked(serving, entry_of, starts, task):
    """What the kit finds of a planted server."""

    def run(planted, *, deadline_s=5.0, earlier=None, restarted=True, moments=starts,
            passes=lambda _: True, **fields):  # fmt: skip
        with serving(planted, planted.metadata) as address:
            opened = []

            def policy():
                opened.append(RemotePolicy(
                    entry_of(**fields), address, task.observation, clock=planted.clock,
                    scene=task.scene_path,
                ))  # fmt: skip
                return opened[-1]

            found = check(
                policy(), moments, asked=question(moments, dataset="d" * 64, candidates=4),
                deadline_s=deadline_s, restarted=policy if restarted else None, earlier=earlier,
                admissible=admissible_where(passes),
            )  # fmt: skip
            for one in opened:
                one.close()
        return found

    return run


def judged(found):
    return {finding.name: finding.judged for finding in found.findings}


def admissible_where(passes):
    return lambda chunk, seen: (
        (True, "") if passes(chunk) else (False, "geometric: scene_collision")
    )


def test_an_honest_candidate_holds_in_everything_that_can_be_said(checked, starts):
    found = checked(Honest(starts))
    # Forty moments bound no 95th percentile; no earlier check was named.
    assert {name for name, what in judged(found).items() if what != "holds"} == {
        "unchanged", "in_time",
    }  # fmt: skip
    assert found.failed == []
    assert found.checkpoint == "a" * 64


@pytest.mark.parametrize(
    ("planted", "fails", "gates"),
    [
        (GlobalSeed, {"repeats", "restarts", "seeded"}, {"B"}),
        (OtherName, {"answers", "repeats", "restarts", "seeded"}, {"B"}),
        (OtherWeights, {"restarts"}, {"B"}),
        (RecordedFuture, {"own_answers"}, {"B"}),
        # Its gripper stands, and its hand is turned as at one moment only.
        (IgnoresObservation, {"follows_observation", "scale", "orientation"}, {"B"}),
        (Millimetres, {"scale"}, {"B"}),
        (Mirrored, {"scale"}, {"B"}),
        (MirroredEitherWay, {"scale"}, {"B"}),
        (Spread, {"scale"}, {"B"}),
        (Narrow, {"scale"}, {"B"}),
        (ClosedGripper, {"scale"}, {"B"}),
        (OtherOrigin, {"origin"}, {"B"}),
        (Turned, {"orientation"}, {"B"}),
        (Exchanged, {"origin"}, {"B"}),
        (Flatters, {"spans"}, {"C"}),
        (Boasts, {"spans"}, {"C"}),
        (CountsAnew, {"evaluations"}, {"B"}),
        (NotANumber, {"answers"}, {"B"}),
        (Fails, {"answers"}, {"B"}),
    ],
)
def test_a_planted_wrong_is_stopped_for_its_reason(checked, starts, planted, fails, gates):
    found = checked(planted(starts))
    assert {finding.name for finding in found.failed} == fails
    assert {finding.gate for finding in found.failed} == gates


@pytest.mark.parametrize("planted", [OtherWay, NoisyGripper])
def test_another_way_and_a_noisy_gripper_are_no_wrong(checked, starts, planted):
    found = checked(planted(starts))
    assert found.failed == []
    assert judged(found)["origin"] == "holds"


def test_a_mirror_is_told_by_where_chunks_begin(checked, starts):
    assert checked(EitherWay(starts)).failed == []
    said = said_of(checked(MirroredEitherWay(starts)), "scale")
    assert said.endswith("wrong: y at the start")


def test_a_wrong_order_of_a_quaternion_is_stopped(checked, starts):
    found = checked(TurnedQuaternion(starts), action=QUATERNION)
    assert [finding.name for finding in found.failed] == ["orientation"]


def test_the_axis_and_the_factor_are_told(checked, starts):
    said = next(f.said for f in checked(Millimetres(starts)).findings if f.name == "scale")
    assert "x 0.000979 (" in said
    assert "wrong: x, y, z, x at the start" in said
    said = next(f.said for f in checked(Mirrored(starts)).findings if f.name == "scale")
    assert said.endswith("wrong: y, y at the start")


def test_an_answer_beyond_the_deadline_is_not_in_time(checked, starts):
    found = checked(Slow(starts), deadline_s=0.002)
    assert [finding.name for finding in found.failed] == ["in_time"]


def test_an_answer_that_never_comes_is_a_fault_with_its_kind(checked, starts):
    never = NeverInTime(starts)
    found = checked(never, timeout_s=2.0)
    never.over.set()
    failed = {finding.name: finding.said for finding in found.failed}
    assert set(failed) == {"answers", "in_time"}
    assert "39 of 40 moments answered; late 1" in failed["answers"]


class AnotherShape(Honest):
    """Answers chunks of nine numbers: the commonest mistake of a first entry."""

    def __call__(self, message):
        answer = super().__call__(message)
        return answer | {"actions": answer["actions"][..., :9]}


def test_a_mistake_in_every_answer_is_told_by_what_it_is(checked, starts):
    """Not by that nobody asks any more; of who never answered nothing is known."""
    found = checked(AnotherShape(starts))
    said = said_of(found, "answers")
    assert said == (
        "0 of 40 moments answered; gone 32, shape 8: chunks of 16 actions of 9 numbers; its entry "
        "says 16 actions and names column 9"
    )
    assert judged(found)["seeded"] == judged(found)["repeats"] == "unknown"
    assert said_of(found, "seeded") == "nothing was answered"


def said_of(found, name):
    return next(finding.said for finding in found.findings if finding.name == name)


def test_what_a_server_says_of_its_time_stands_beside_what_it_took(checked, starts):
    assert "2.9 of 3 ms; a ping takes up to 0 ms" in said_of(checked(Honest(starts)), "spans")
    assert "1 of 500 ms" in said_of(checked(Flatters(starts)), "spans")
    boasts = said_of(checked(Boasts(starts)), "spans")
    assert boasts.startswith("at 1 of 40 moments")
    assert boasts.endswith("6e+04 of 3 ms")


class StatesMore(Honest):
    """Measures a term that is not of the model, too."""

    def __init__(self, starts):
        super().__init__(starts)
        spans = {"preprocess": 1e-4, "encode": 1e-4, "sample": 7e-4, "network": 2e-3}
        self.metadata[WORD]["spans"] = [*spans]
        self.said = {"spans_s": spans}


def test_what_it_states_of_others_terms_is_said_to_count_as_sampling(checked, starts):
    """As the ladder counts it: see `genpolicy.candidates.wire.spans`."""
    found = checked(StatesMore(starts))
    said = said_of(found, "spans")
    assert "2.9 of 3 ms" in said
    assert "of it network 2 ms, which the ladder counts as sample" in said
    assert judged(found)["spans"] == "holds"
    assert "counts as sample" not in said_of(checked(Honest(starts)), "spans")


def test_without_a_ping_the_wire_may_be_what_takes_so_long(checked, starts, monkeypatch):
    monkeypatch.setattr(RemotePolicy, "round_trip_s", lambda _: None)
    found = checked(Flatters(starts))
    assert found.failed == []
    assert judged(found)["spans"] == "unknown"
    assert judged(checked(Honest(starts)))["spans"] == "holds"


def test_what_is_as_long_as_the_wire_is_the_wire(checked, starts, monkeypatch):
    monkeypatch.setattr(RemotePolicy, "round_trip_s", lambda _: 0.49)
    assert judged(checked(Flatters(starts)))["spans"] == "holds"


def test_a_count_is_a_claim(checked, starts):
    said = said_of(checked(Honest(starts)), "evaluations")
    assert said == "it counts 4 for a sample, which nobody else can"


def test_what_left_an_answer_out_is_not_compared(checked, starts):
    before = checked(Honest(starts)).answers_sha256
    fails = Fails(starts)
    fails.at = 4  # a moment that is asked again
    found = checked(fails, earlier=before)
    assert found.answers_sha256 is None
    assert judged(found)["unchanged"] == "unknown"


def test_a_question_is_its_moments_their_number_and_the_dataset(starts):
    one = question(starts, dataset="d" * 64, candidates=4)
    assert one == question(starts, dataset="d" * 64, candidates=4)
    other = starts.observations.copy()
    other[0, 0, 0] += 1e-9
    moved = question(replace(starts, observations=other), dataset="d" * 64, candidates=4)
    assert moved.observations_sha256 != one.observations_sha256


def test_another_answer_than_at_the_earlier_check_is_another_candidate(checked, starts):
    before = checked(Honest(starts)).answers_sha256
    assert judged(checked(Honest(starts), earlier=before))["unchanged"] == "holds"

    class Retrained(Honest):
        def chunk(self, row, noise):
            return super().chunk(row, ("retrained", *noise))

    found = checked(Retrained(starts), earlier=before)
    assert [finding.name for finding in found.failed] == ["unchanged"]


def test_one_that_repeats_nothing_has_no_identity(checked, starts):
    found = checked(GlobalSeed(starts), earlier="0" * 64)
    assert found.answers_sha256 is None
    assert judged(found)["unchanged"] == "fails"


def test_a_plain_server_that_draws_cannot_be_seeded(checked, starts):
    found = checked(Honest(starts, plain=True))
    assert {finding.name for finding in found.failed} == {"repeats", "restarts", "seeded"}
    assert judged(found)["evaluations"] == judged(found)["spans"] == "unknown"
    assert "takes no name of the noise" in next(
        finding.said for finding in found.findings if finding.name == "seeded"
    )


def test_a_plain_server_that_draws_nothing_reproduces(checked, starts):
    class Mean(Honest):
        def chunk(self, row, noise):
            return super().chunk(row, (row,))

    found = checked(Mean(starts, plain=True))
    assert found.failed == []
    assert judged(found)["seeded"] == "holds"


def test_what_was_not_started_here_cannot_be_started_again(checked, starts):
    found = checked(Honest(starts), restarted=False)
    assert judged(found)["restarts"] == "unknown"
    assert found.failed == []


def test_of_few_moments_nothing_is_said_about_units(checked, starts):
    few = replace(
        starts, observations=starts.observations[:19], chunks=starts.chunks[:19],
        episodes=starts.episodes[:19], measured=starts.measured[:19],
    )  # fmt: skip
    found = judged(checked(Millimetres(starts), moments=few))
    names = ("follows_observation", "scale", "origin", "orientation", "own_answers")
    assert [found[name] for name in names] == ["unknown"] * 5


def test_how_many_moments_have_a_chunk_that_passes_every_layer(checked, starts):
    def found_of(planted, **fields):
        return next(f for f in checked(planted, **fields).findings if f.name == "admissible")

    never = found_of(Honest(starts), passes=lambda chunk: False)
    assert never.judged == "fails"
    assert "at 0 of 40 moments, the recorded one at 0; geometric: scene_collision 160" in never.said
    half = starts.chunks[20:, 0, 0]
    sometimes = found_of(
        Honest(starts), passes=lambda chunk: np.abs(chunk[0, 0] - half).min() < 1e-12
    )
    assert sometimes.judged == "fails"  # only the recorded chunks themselves, of half of them
    assert "the recorded one at 20" in sometimes.said
    third = iter(range(10_000))
    one_in_four = found_of(Honest(starts), passes=lambda chunk: next(third) % 4 == 0)
    assert one_in_four.judged == "holds"  # one chunk of four at each moment is enough


def test_a_candidate_in_joint_space_is_judged_as_the_same_one_in_poses(checked, starts):
    found = checked(InJoints(starts), action=JOINTS)
    assert judged(found) == judged(checked(Honest(starts)))
    wrong = checked(InDegrees(starts), action=JOINTS)
    assert {"follows_observation", "orientation"} <= {finding.name for finding in wrong.failed}


def test_without_a_task_nothing_is_said_about_layers(serving, entry, starts, task):
    with serving(planted := Honest(starts), planted.metadata) as address:
        policy = RemotePolicy(entry, address, task.observation)
        found = check(
            policy, starts, asked=question(starts, dataset="d" * 64, candidates=2),
            deadline_s=5.0, restarted=None,
        )  # fmt: skip
        policy.close()
    assert judged(found)["admissible"] == "unknown"


def test_times_and_layers_are_of_one_moment_of_each_episode(checked, starts):
    """Those of one episode are no independent trials."""
    moments = replace(
        starts,
        observations=np.concatenate([starts.observations, starts.observations + 1e-6]),
        chunks=np.tile(starts.chunks, (2, 1, 1)),
        episodes=np.tile(starts.episodes, 2),
        measured=np.tile(starts.measured, (2, 1)),
    )

    class SlowerLater(Honest):
        @property
        def takes_s(self):
            return 0.003 if self.asked <= len(starts) else 6.0

    tried = []
    found = checked(SlowerLater(moments), moments=moments, passes=lambda _: not tried.append(0))
    assert found.failed == []
    assert (found.asked.episodes, found.asked.moments) == (40, 80)
    assert len(tried) == 40 * 5  # four candidates and the recorded chunk
    assert "80 of 80 moments answered" in said_of(found, "answers")
