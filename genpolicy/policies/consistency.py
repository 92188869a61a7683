"""Consistency flow matching: the mean velocity of the way left in a segment of the flow.

Plain flow matching learns where the flow points now, so that one long step ends at the mean of
all modes. Here the network says where it leads until the end of the segment; a sampler then
jumps from segment to segment, one evaluation each.
"""

import torch
from torch import Tensor

from genpolicy.policies.networks import Dimensions, PolicyNetwork
from genpolicy.policies.objectives import Batch, Objective, masked_mean, normal_like
from genpolicy.policies.schedules import straight_path
from genpolicy.policies.settings import HeadConfig, NetworkConfig

# Flow time between the two points that must agree. A longer one averages over the modes that the
# straight paths lead to from one point; a shorter one passes what is known at the segment's end
# back more slowly.
STRIDE = 0.02


class SegmentConsistency(Objective):
    """Two points of one path, a stride apart, must name the same end of their segment.

    From a point x at time t to the end e of its segment the network's mean velocity v leads to
    x + (e - t) v. The target goes a stride along the path and from there on as the network says,
    without a gradient: of the way left, the stride's share has the path's velocity and the rest
    the network's. Within a stride of the end it is the path's velocity alone, which is what fixes
    all the others. Divided by (e - t), the error is that of the velocity, so that short ways,
    from which the others learn, count as much as long ones.

    Source:
        Yang et al., arXiv 2407.02398, and Zhang et al., arXiv 2412.04987 (FlowPolicy); their
        second term, of weight 1e-5, and their averaged target network are left out.
    """

    def __init__(self, dimensions: Dimensions, network: NetworkConfig, head: HeadConfig) -> None:
        super().__init__()
        self._segments = head.flow_segments

    def loss(self, network: PolicyNetwork, batch: Batch, generator: torch.Generator) -> Tensor:
        """Masked mean squared error of the mean velocity."""
        noise = normal_like(batch.actions, generator)
        rows, device = (len(noise),), noise.device
        segment = torch.randint(self._segments, rows, generator=generator, device=device)
        within = torch.rand(rows, generator=generator, dtype=noise.dtype, device=device)
        time, left = (segment + within) / self._segments, (1.0 - within) / self._segments
        stride = left.clamp(max=STRIDE)
        point, velocity = straight_path(noise, batch.actions, time)
        ahead, _ = straight_path(noise, batch.actions, time + stride)
        condition = network.encode(batch.observations)
        predicted = network.evaluate(condition, point, time)
        with torch.no_grad():
            beyond = network.evaluate(condition, ahead, time + stride)
            share = (stride / left)[:, None, None]
            target = share * velocity + (1.0 - share) * beyond
        return masked_mean((predicted - target).square(), batch.weight)
