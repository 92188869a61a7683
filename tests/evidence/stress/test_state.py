"""An invocation in flight: what it suffers is a function of its key, and it arrives after it."""

from dataclasses import replace

import numpy as np
import pytest

from genpolicy.contract.chunk import ChunkMetadata
from genpolicy.evidence.stress.perturbations import ChunkDrop, PolicyStall
from genpolicy.evidence.stress.state import Tally, in_flight

METADATA = ChunkMetadata(
    chunk_id="c", condition_observation_event_time_s=1.95, policy_checkpoint_hash="w",
    sampler_config_hash="s", action_start_time_s=2.0, action_period_s=0.05, valid_until_s=2.8,
    task_phase="approach", calibration_epoch="e0", predecessor_chunk_id="", session_epoch=1,
    method="scripted", candidate_index=0,
)  # fmt: skip
SEEN = np.arange(3.0)
SENSOR_S = {"exposure": 0.001, "capture": 0.0015, "decode": 0.001, "transfer": 0.0015}


@pytest.fixture
def begin(make_fixture):
    def make(*, start=0, number=1, metadata=METADATA, **changes):
        return in_flight(
            make_fixture(**changes), metadata, SEEN,
            sensor_s=SENSOR_S, start=start, number=number,
        )  # fmt: skip

    return make


def test_its_times_count_from_what_it_saw(begin):
    found = begin()
    assert found.exposed_s == 1.95 and found.arrival_s == pytest.approx(1.95 + found.total_s)
    # Compute terms sum to 30 ms, its observation took 5 ms, network and queue take 2 to 4 ms.
    assert 0.03 + 0.005 + 0.002 <= found.total_s <= 0.03 + 0.005 + 0.004
    assert not found.dropped and not found.given_up and found.chunks is None
    later = begin(metadata=replace(METADATA, condition_observation_event_time_s=3.0))
    assert later.arrival_s == pytest.approx(3.0 + found.total_s)


def test_the_same_key_suffers_the_same_and_each_part_of_it_counts(begin):
    found = begin().total_s
    assert begin().total_s == found == begin(method="another").total_s
    others = {begin(start=1).total_s, begin(number=2).total_s, begin(root_seed=8).total_s,
              begin(perturbation="other").total_s}  # fmt: skip
    assert len(others | {found}) == 5


def test_what_is_injected_is_added_or_lost(begin):
    late = begin(schedule=PolicyStall(probability=1.0, magnitude_s=0.2))
    assert late.total_s == pytest.approx(begin().total_s + 0.2)
    assert begin(schedule=ChunkDrop(kind="chunk_drop", probability=1.0)).dropped


def test_five_ms_of_sampling_are_five_ms_of_an_answer_and_whole_ticks_of_an_action(begin, kit):
    """What comes is as old as it took, to the nanosecond; what is accepted waits for a tick.

    Golden: an answer of 37 to 39 ms takes 5 more, at every quantile. The controller looks every 50
    ms, so that its first action is no older for it; one of 49 to 51 ms is a whole tick older.
    """
    period_s = kit.HORIZONS.action_period_s

    def ages_s(compute_s):
        model = kit.latency(compute_s)
        return np.sort([begin(start=n, latency=model).total_s for n in range(300)])

    quick, slow, slower = ages_s(0.03), ages_s(0.035), ages_s(0.042)
    assert len(set(quick)) == 300  # a distribution, and no few values
    np.testing.assert_allclose(slow - quick, 0.005, atol=1e-12)
    accepted = [np.ceil(ages / period_s) for ages in (quick, slow, slower)]
    assert set(accepted[0]) == set(accepted[1]) == {1.0}
    assert set(accepted[2]) == {1.0, 2.0}


def test_the_journal_of_a_rollout_is_named_by_its_start(make_fixture):
    fixture = make_fixture(perturbation="storm")
    journal = fixture.journal(3, "f" * 64)
    assert journal.session == "scripted/storm/3"
    assert journal.session != fixture.journal(4, "f" * 64).session


def test_tallies_share_nothing():
    one, other = Tally(), Tally()
    one.rejected_by["finite"] = 1
    one.latencies_s.append(0.1)
    assert other.rejected_by == {} and other.latencies_s == []
