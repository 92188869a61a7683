"""Offline errors and selection."""

import numpy as np
import pytest

from genpolicy.contract.chunk import Candidate, ChunkMetadata
from genpolicy.errors import ConfigError, ContractError
from genpolicy.policies.normalisation import MinMax, Normalisation
from genpolicy.policies.offline import masked_errors
from genpolicy.policies.policy import Samples
from genpolicy.policies.selection import select
from genpolicy.policies.windows import Windows


class ConstantPolicy:
    """Answers the same action everywhere."""

    method, checkpoint_hash, sampler_config_hash = "constant", "c" * 64, "s" * 64
    stochastic = False

    def __init__(self, horizon):
        self.prediction_horizon = horizon

    def sample(self, observations, *, noise_names, candidates):
        shape = (len(observations), candidates, self.prediction_horizon, 10)
        return Samples(np.full(shape, 0.5), 1)


def case(horizon):
    actions = np.full((4, 3, 10), 0.5)
    actions[2:, 0, 0] += 0.03
    actions[:, 2] = 77.0
    is_pad = np.zeros((4, 3), dtype=bool)
    is_pad[:, 2] = True
    statistics = MinMax(np.zeros(10), np.full(10, 2.0))
    return masked_errors(
        ConstantPolicy(horizon),
        Windows(np.zeros((4, 2, 5)), actions, is_pad),
        phases=np.array(["align", "align", "insert", "insert"]),
        normalisation=Normalisation(statistics, statistics),
        noise_names=[("w", i) for i in range(4)],
    )


@pytest.mark.parametrize(("horizon", "counted"), [(1, 1), (3, 2)])
def test_errors_by_phase_leave_padding_out(horizon, counted):
    align, insert = case(horizon)
    assert (align.phase, align.masked_mae, align.position_rmse_m) == ("align", 0.0, 0.0)
    assert insert.windows == 2
    assert insert.masked_mae == pytest.approx(0.03 / 10 / counted)
    assert insert.position_rmse_m == pytest.approx(0.03 / counted**0.5)


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
