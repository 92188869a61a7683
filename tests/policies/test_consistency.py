"""FlowPolicy: the loss by hand, and a two-mode toy on which one step tells the methods apart."""

import numpy as np
import pytest
import torch

from genpolicy.policies.checkpoint import load_checkpoint
from genpolicy.policies.consistency import STRIDE, SegmentConsistency
from genpolicy.policies.objectives import Batch
from genpolicy.policies.policy import load_policy
from genpolicy.policies.settings import HeadConfig, SamplerConfig
from genpolicy.policies.training import train
from genpolicy.statistics.intervals import clopper_pearson

DRAWN = 400


@pytest.fixture(scope="module")
def shares(tmp_path_factory, two_mode_windows, request_for):
    """Interval of the share of each mode, and of what lies between them, of samples drawn.

    A sample belongs to the mode at -1 or +1 that it is nearer to than half the way to the mean.
    """
    root, windows = tmp_path_factory.mktemp("toy"), two_mode_windows(1024)

    def draw(method, *, segments, steps, name):
        folder = root / f"{method}_{segments}"
        sampler = SamplerConfig(name=name, steps=steps)
        if not folder.exists():
            head = HeadConfig(latent_dim=4, posterior_width=16, flow_segments=segments)
            request = request_for(method, updates=500, head=head, sampler=sampler)
            train(folder, request, windows=windows)
        policy = load_policy(folder, sampler=sampler)
        samples = policy.sample(np.zeros((1, 2, 3)), noise_names=[("toy",)], candidates=DRAWN)
        assert samples.nfe == steps
        first = samples.actions[0, :, 0, 0]
        return {
            place: clopper_pearson(int((np.abs(first - at) < 0.5).sum()), DRAWN, 0.99)
            for place, at in (("left", -1.0), ("between", 0.0), ("right", 1.0))
        }

    return draw


def test_one_euler_step_of_plain_flow_collapses_to_the_mean(shares):
    """What the toy must tell: the velocity at the start points to the mean of both modes."""
    found = shares("flow", segments=2, steps=1, name="euler")
    assert found["between"][0] > 0.6
    assert found["left"][1] < 0.2 and found["right"][1] < 0.2


@pytest.mark.parametrize(("segments", "steps"), [(1, 1), (2, 2), (2, 4)])
def test_as_many_jumps_as_segments_keep_both_modes(shares, segments, steps):
    found = shares("flow_policy", segments=segments, steps=steps, name="consistency")
    assert found["left"][0] > 0.25 and found["right"][0] > 0.25
    assert found["between"][1] < 0.3


def test_more_segments_leave_less_between_the_modes(shares):
    one, two = (
        shares("flow_policy", segments=count, steps=count, name="consistency") for count in (1, 2)
    )
    assert two["between"][1] < one["between"][0]


class Straight(torch.nn.Module):
    """Says the velocity of one known straight path, wherever it is asked; plus a constant."""

    def __init__(self, error):
        super().__init__()
        self.error, self.asked = torch.nn.Parameter(torch.tensor(error)), []

    def encode(self, observations):
        return observations

    def evaluate(self, condition, values, time):
        self.asked.append((values.detach(), time))
        left = (1.0 - time[:, None, None]).clamp(min=1e-12)
        velocity = (1.0 - values) / left  # to the action of ones
        return velocity + self.error


@pytest.mark.parametrize("segments", [1, 2, 4])
def test_the_points_lie_in_one_segment_and_the_loss_is_that_of_the_stride(segments):
    """A network off by a constant c differs from its target by c times the stride's share."""
    batch = Batch(torch.zeros(4000, 2, 3), *[torch.ones(4000, 1, 1).double()] * 2)
    objective = SegmentConsistency(None, None, HeadConfig(flow_segments=segments))
    network = Straight(0.5)
    loss = objective.loss(network, batch, torch.Generator().manual_seed(2))
    (_, time), (_, ahead) = network.asked
    segment = torch.floor(time * segments)
    left = (segment + 1.0) / segments - time
    stride = ahead - time
    assert bool((stride > 0).all() and (stride <= STRIDE + 1e-6).all())
    assert bool((ahead <= (segment + 1.0) / segments + 1e-6).all())
    assert set(segment.tolist()) == set(range(segments))
    share = torch.where(left <= STRIDE, torch.ones(()), stride / left)
    assert loss.item() == pytest.approx(float((0.5 * share).square().mean()), rel=2e-2)
    # The target is held: only the first of the two evaluations moves the weights.
    loss.backward()
    assert float(network.error.grad) == pytest.approx(float(2.0 * 0.5 * share.mean()), rel=2e-2)


def test_an_optimum_is_a_fixed_point(folders):
    """The true mean velocity of a straight flow has no loss, whatever the stride."""
    batch = Batch(torch.zeros(256, 2, 3), *[torch.ones(256, 1, 1).double()] * 2)
    objective = SegmentConsistency(None, None, HeadConfig())
    loss = objective.loss(Straight(0.0), batch, torch.Generator().manual_seed(2))
    assert loss.item() < 1e-6
    assert load_checkpoint(folders["flow_policy"]).config.head.flow_segments == 2
