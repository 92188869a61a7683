"""What is counted is what a checkpoint says of itself, and of a training what its loss does."""

from types import SimpleNamespace

import pytest

from genpolicy.candidates.judged import trained
from genpolicy.evidence.reproducibility import compute
from genpolicy.evidence.reproducibility.compute import (
    compute_rows,
    part_operations,
    update_operations,
)
from genpolicy.evidence.rows.reproducibility import PARTS
from genpolicy.policies.methods import METHODS
from genpolicy.policies.networks import flops_per_evaluation
from genpolicy.policies.settings import NetworkConfig, SamplerConfig


@pytest.mark.parametrize("method", ["flow", "chunked_bc", "bc"])
def test_parts_are_counted_as_training_wrote_them(fleet, method):
    (candidate,) = trained(fleet[0], [method], seeds=[0], device="cpu")
    config = candidate.load().checkpoint.config
    rows = {row.part: row for row in compute_rows(candidate)}
    assert {part: rows[part].parameters for part in PARTS} == {
        part: config.parameters[part] for part in PARTS
    }
    assert {part: rows[part].operations for part in PARTS} == {
        part: config.flops[part] for part in PARTS
    }
    assert rows["update"].parameters == config.training_only_parameters == 0


def test_an_update_is_one_way_there_and_about_two_back(fleet):
    """The first layer of each kind of input needs no gradient of what it is given."""
    (flow,) = trained(fleet[0], ["flow"], seeds=[0], device="cpu")
    checkpoint = flow.load().checkpoint
    only, update = update_operations(flow, checkpoint.network, checkpoint.config)
    once = checkpoint.config.flops["total"]
    assert only == 0 and 2 * once < update <= 3 * once


@pytest.mark.parametrize(
    "name", [name for name, method in METHODS.items() if method.weights_of is None]
)
def test_every_method_can_be_counted(fleet, name, monkeypatch):
    """Each trains more than once through its network, a distillation with its teacher besides."""
    (flow,) = trained(fleet[0], ["flow"], seeds=[0], device="cpu")
    method, own = METHODS[name], flow.load().checkpoint.config
    config = own.model_copy(
        update={"method": name, "sampler": SamplerConfig(name=method.samplers[0])}
    )
    network = method.build(own.dimensions, own.network, own.head)
    if method.teacher is not None:
        teacher = METHODS[method.teacher].build(own.dimensions, own.network, own.head)
        monkeypatch.setattr(compute, "load_checkpoint", lambda _: SimpleNamespace(network=teacher))
    spent = part_operations(network, config, config.sampler)
    only, update = update_operations(flow, network, config)
    assert min(spent.values()) > 0 and update > flops_per_evaluation(network)["total"]
    objective = method.objective(own.dimensions, own.network, own.head)
    if method.teacher is not None:
        objective.learn_from(teacher, network)
    assert only == sum(values.numel() for values in objective.parameters())
    assert all(values.grad is None for values in network.parameters())


def test_a_layer_that_runs_twice_is_counted_twice(fleet):
    (flow,) = trained(fleet[0], ["flow"], seeds=[0], device="cpu")
    checkpoint = flow.load().checkpoint
    network, config = checkpoint.network, checkpoint.config
    before = part_operations(network, config, config.sampler)
    read_out, direct = network.head.read_out, network.head.direct
    network.head.read_out = lambda features: read_out(features) + 0.0 * direct(features)
    after = part_operations(network, config, config.sampler)
    more = 2 * direct.in_features * direct.out_features
    assert after == {**before, "head": before["head"] + more}


def test_products_outside_of_layers_are_the_trunks(fleet):
    (flow,) = trained(fleet[0], ["flow"], seeds=[0], device="cpu")
    checkpoint = flow.load().checkpoint
    config = checkpoint.config
    network = METHODS["flow"].build(
        config.dimensions, NetworkConfig(trunk="transformer"), config.head
    )
    counted = part_operations(network, config, config.sampler)
    stated = flops_per_evaluation(network)
    assert counted["trunk"] > stated["trunk"]
    assert {part: counted[part] for part in ("encoder", "head")} == {
        part: stated[part] for part in ("encoder", "head")
    }
