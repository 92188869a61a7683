"""Selection of one candidate among admitted ones."""

import numpy as np
import pytest

from genpolicy.contract.chunk import Candidate, ChunkMetadata
from genpolicy.errors import ConfigError, ContractError
from genpolicy.policies.selection import select


def candidate(index):
    metadata = ChunkMetadata(
        chunk_id=f"c{index}", condition_observation_event_time_s=0.0, policy_checkpoint_hash="",
        sampler_config_hash="", action_start_time_s=0.0, action_period_s=0.05, valid_until_s=1.0,
        task_phase="align", calibration_epoch="e", predecessor_chunk_id="", session_epoch=0,
        method="m", candidate_index=index,
    )  # fmt: skip
    return Candidate(metadata, np.full((2, 10), float(index)))


def test_selection():
    proposal = select([candidate(0), candidate(1)])
    assert (proposal.metadata.candidate_index, proposal.selected_by) == (0, "first")
    with pytest.raises(ContractError):
        select([])
    with pytest.raises(ConfigError, match="selector"):
        select([candidate(0)], selector="best")
