"""An exported checkpoint draws what the checkpoint draws, by the same names of the noise."""

from dataclasses import replace

import numpy as np
import pytest

from genpolicy.candidates.exports.onnx_export import onnx_bytes
from genpolicy.candidates.exports.torch_export import torch_bytes
from genpolicy.candidates.exports.unrolled import NOISE, apart, whole
from genpolicy.candidates.hosts.onnx_program import OnnxProgram
from genpolicy.candidates.hosts.torch_program import TorchProgram
from genpolicy.errors import ConfigError
from genpolicy.policies.methods import METHODS
from genpolicy.policies.networks import Dimensions
from genpolicy.policies.policy import NetworkPolicy
from genpolicy.policies.settings import SamplerConfig
from genpolicy.seeds import counter_noise

TORCH, ONNX = 1e-6, 2e-5
"""m, or of a number of a rotation. Measured on small checkpoints: torch up to 5e-8, from the rows
of a call alone; ONNX up to 5e-6 (DDIM), since its runtime adds in another order and the first step
of a diffusion divides by a small number. Of the configured size: see docs/candidates.md."""
SAMPLERS = {
    "flow": ("euler", "heun"), "diffusion": ("ddim", "ddpm"), "chunked_bc": ("direct",),
    "act": ("z_prior",), "bc_noise": ("offset",), "manicm": ("multistep_consistency",),
}  # fmt: skip


@pytest.fixture(scope="module")
def policy_of(policy, kit):
    """A policy of a method with a sampler: small weights drawn by a seed, the flow's statistics."""

    def make(method, name, **settings):
        base, kind = policy.checkpoint, METHODS[method]
        sizes = Dimensions(**base.config.dimensions.model_dump(exclude={"phase_columns"}))
        network = kind.build(sizes, base.config.network, base.config.head).eval()
        rng = np.random.default_rng(5)
        for parameter in network.parameters():
            values = rng.normal(scale=0.1, size=tuple(parameter.shape)).astype(np.float32)
            parameter.data.copy_(parameter.data.new_tensor(values))
        if "scale" in dict(network.named_buffers()):
            network.scale.fill_(0.1)
        steps = 1 if name in ("direct", "z_prior", "offset") else 4
        sampler = SamplerConfig(**{"name": name, "steps": steps, **settings})
        config = base.config.model_copy(
            update={"method": method, "dimensions": sizes, "sampler": sampler}
        )
        return NetworkPolicy(replace(base, config=config, network=network))

    return make


def drawn(program, exported, policy, seen, candidates, encoder=None):
    """Chunks as the host draws them."""
    given = {"observation": seen}
    if encoder is not None:
        given = {"condition": encoder.run(given)}
    chunks = []
    for row in range(candidates):
        noise = {}
        if NOISE in exported.inputs:
            said = exported.noise(policy.checkpoint_hash)
            names = (said["stream"], "a", 7, row)
            draws = [counter_noise((*names, step), shape=tuple(said["shape"]))
                     for step in range(said.get("steps", 1))]  # fmt: skip
            noise[NOISE] = np.stack(draws) if "steps" in said else draws[0]
        chunks.append(program.run({**given, **noise}))
    return np.stack(chunks)


def compared(policy, seen, forms, candidates):
    exported = whole(policy)
    expected = policy.sample(seen[None], noise_names=[("a", 7)], candidates=candidates)
    for load, tolerance in forms:
        program = load(exported)
        found = drawn(program, exported, policy, seen, candidates)
        assert np.abs(found - expected.actions[0]).max() < tolerance
        assert program.uses(exported.counted_weight) == expected.nfe


def as_torch(exported):
    return TorchProgram(torch_bytes(exported), where="policy.pt2", threads=1)


def as_onnx(exported):
    return OnnxProgram(onnx_bytes(exported), where="policy.onnx", threads=1, external=None)


@pytest.fixture(scope="module")
def seen(data):
    return data.windows("test", 2, 16).observations[3]


@pytest.mark.parametrize(("method", "name"), [("flow", "euler"), ("diffusion", "ddim")])
def test_both_forms_draw_what_the_checkpoint_draws(policy_of, seen, method, name):
    policy = policy_of(method, name)
    programs = [(as_torch(whole(policy)), TORCH), (as_onnx(whole(policy)), ONNX)]
    for candidates in (1, 4):
        forms = [(lambda _, own=program: own, tolerance) for program, tolerance in programs]
        compared(policy, seen, forms, candidates)


@pytest.mark.parametrize(
    ("method", "name"), [(method, name) for method, names in SAMPLERS.items() for name in names]
)
def test_every_sampler_that_can_be_written_out(policy_of, seen, method, name):
    compared(policy_of(method, name), seen, [(as_torch, TORCH)], 2)


def test_a_step_less_is_seen(policy_of, seen):
    """The fault that the tolerance is there for."""
    policy, other = policy_of("flow", "euler"), policy_of("flow", "euler", steps=3)
    with pytest.raises(AssertionError):
        compared(policy, seen, [(lambda _: as_torch(whole(other)), TORCH)], 1)


def test_encoder_and_sampler_apart_draw_the_same(policy_of, seen):
    policy = policy_of("flow", "euler")
    first, second = apart(policy)
    expected = policy.sample(seen[None], noise_names=[("a", 7)], candidates=2).actions[0]
    encoder, sampler = as_torch(first), as_torch(second)
    found = drawn(sampler, second, policy, seen, 2, encoder=encoder)
    assert np.abs(found - expected).max() < TORCH
    assert sampler.uses(second.counted_weight) == 4


def test_what_a_constant_number_of_the_dataset_becomes(policy_of, seen):
    policy = policy_of("flow", "euler")
    low = policy.checkpoint.normalisation.observation
    assert (low.maximum - low.minimum <= 1e-6).any()
    compared(policy, seen + 1.0, [(as_torch, TORCH)], 1)


@pytest.mark.parametrize(
    ("method", "settings"),
    [
        ("flow", {"name": "bosh3", "steps": 4, "nfe_cap": 64}),
        ("ibc", {"name": "langevin", "steps": 2, "population": 8}),
        ("ibc", {"name": "derivative_free", "steps": 2, "population": 8}),
    ],
)
def test_a_sampler_whose_steps_depend_on_what_it_finds_is_refused(policy_of, method, settings):
    with pytest.raises(ConfigError, match="depend on what it finds"):
        whole(policy_of(method, **settings))
