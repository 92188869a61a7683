"""The selector: the first that is admitted, in the order drawn; what is stale is over."""

import numpy as np
import pytest

from genpolicy.candidates.selector import SELECTOR, propose, tries_another
from genpolicy.contract.chunk import Candidate, ChunkMetadata
from genpolicy.errors import ContractError


def candidate(index):
    metadata = ChunkMetadata(
        chunk_id=f"c{index}", condition_observation_event_time_s=0.0, policy_checkpoint_hash="",
        sampler_config_hash="", action_start_time_s=0.0, action_period_s=0.05, valid_until_s=1.0,
        task_phase="align", calibration_epoch="e", predecessor_chunk_id="", session_epoch=0,
        method="m", candidate_index=index,
    )  # fmt: skip
    return Candidate(metadata, np.full((2, 10), float(index)))


def test_candidates_have_their_turn_in_the_order_drawn():
    drawn = [candidate(0), candidate(1)]
    for index in (0, 1):
        proposal = propose(drawn, index)
        assert proposal.metadata.candidate_index == index and proposal.selected_by == SELECTOR
        assert np.array_equal(proposal.actions, drawn[index].actions)


@pytest.mark.parametrize(("count", "index"), [(0, 0), (2, 2), (2, -1)])
def test_there_is_no_other(count, index):
    with pytest.raises(ContractError, match="nothing to propose"):
        propose([candidate(i) for i in range(count)], index)


def test_another_is_tried_until_all_were_refused_or_all_are_stale():
    assert [tries_another(i, 3, stale=False) for i in range(3)] == [True, True, False]
    assert not any(tries_another(i, 3, stale=True) for i in range(3))
