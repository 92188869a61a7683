"""A method or sampler that is none is told with its key before anything trains."""

import pytest
import yaml

from genpolicy.errors import ConfigError
from stages._samplers import require_samplers
from stages._stage import load_params
from tests.stages.conftest import ROOT

DDIM, ADAPTIVE = {"name": "ddim", "steps": 4}, {"name": "bosh3", "steps": 4}


def put(place, value):
    """An edit that puts a value at a dotted place of the parameters."""
    *path, last = place.split(".")

    def change(params):
        for key in path:
            params = params[key]
        params[last] = value

    return change


@pytest.fixture
def refused(workspace, edit):
    """The sentence with which the parameters are refused after an edit; None where they are not."""

    def ask(place, value):
        edit(workspace, put(place, value))
        try:
            require_samplers(load_params())
        except ConfigError as error:
            return str(error)
        return None

    return ask


@pytest.mark.parametrize(
    ("place", "value", "told"),
    [
        ("reload.sweep", {"diffusoin": [2]},
         "reload.sweep.diffusoin is 'diffusoin', expected one of diffusion, flow, cvae"),
        ("reload.sweep.diffusion", [4, 200],
         "reload.sweep.diffusion[1].steps is 200, expected between 1 and the 100 levels"),
        ("reload.sweep.diffusion", [0], "reload.sweep.diffusion[0].steps is 0, expected between 1"),
        ("reload.sweep.flow", [20_000], "reload.sweep.flow[0].steps"),
        ("reload.sweep.diffusion", [{"name": "euler", "steps": 4}],
         "reload.sweep.diffusion[0].name is 'euler', expected one of ddim, ddpm"),
        ("reload.sweep.flow", [ADAPTIVE],
         "reload.sweep.flow[0].nfe_cap is None, expected a number, for bosh3"),
        ("reload.sweep.flow", [{**ADAPTIVE, "nfe_cap": 2}],
         "reload.sweep.flow[0].nfe_cap is 2, expected at least"),
        ("train_factors.variants.l1_head", {"factor": "head", "method": "chunked_l2"},
         "train_factors.variants.l1_head.method is 'chunked_l2', expected one of bc, chunked_bc"),
        ("train_factors.variants.act_head", {"factor": "head", "method": "act", "sampler": DDIM},
         "train_factors.variants.act_head.sampler.name is 'ddim', expected one of z_zero"),
        ("train_factors.variants.l1_head", {"factor": "head", "method": "flow"},
         "train_factors.variants.l1_head is without a sampler, and no baseline is flow"),
        ("train_factors.variants.newest_only.observation_horizon", 0,
         "train_factors.variants.newest_only.observation_horizon is 0, expected at least 1"),
        ("train_factors.variants.l1_head.factor", "reference",
         "train_factors.variants is 2 references, expected exactly one"),
        ("measure_baselines.conventions", {"nobody": {"z_prior": {"name": "z_prior"}}},
         "measure_baselines.conventions.nobody is 'nobody', expected one of bc"),
        ("measure_baselines.conventions.act", {"z_prior": DDIM},
         "measure_baselines.conventions.act.z_prior.name is 'ddim'"),
        ("measure_baselines.latent.convention", "z_zero",
         "measure_baselines.latent.convention is 'z_zero', expected one of z_prior"),
        ("measure_baselines.latent.method", "cvae",
         "measure_baselines.latent.method is 'cvae', expected one of act"),
        ("train_baselines.samplers.act", DDIM,
         "train_baselines.samplers.act.name is 'ddim', expected one of z_zero, z_prior"),
        ("train_baselines.samplers.chunked_bc", {"name": "direct", "steps": 2},
         "train_baselines.samplers.chunked_bc.steps is 2, expected exactly 1"),
        ("train_generators.samplers.flow_policy", {"name": "consistency", "steps": 1},
         "train_generators.samplers.flow_policy.steps is 1, expected a multiple of the 2 segments"),
        ("train_generators.samplers.flow.eta", 0.5,
         "train_generators.samplers.flow.eta is 0.5, expected 0 for euler"),
        ("train_baselines.samplers.ibc.population", 1,
         "train_baselines.samplers.ibc.population is 1, expected at least 2"),
        ("train_baselines.samplers", {"bc_noise": {"name": "offset"}},
         "train_baselines.samplers.bc_noise is trained without chunked_bc"),
    ],
)  # fmt: skip
def test_what_would_be_found_behind_the_training_is_refused_before_it(refused, place, value, told):
    said = refused(place, value)
    assert (said is not None and "params.yaml: " in said) or "train_factors" in said, said
    assert told in said, said


@pytest.mark.parametrize(
    ("place", "value"),
    [
        ("seed", 20261127),
        ("reload.sweep", {"diffusoin": [], "flow": [{**ADAPTIVE, "nfe_cap": 60}, 8]}),
        ("measure_baselines.conventions.chunked_l1", {"again": {"name": "direct"}}),
        ("train_generators.samplers.manicm", {"name": "multistep_consistency", "steps": 2}),
        ("measure_baselines.latent", None),
    ],
)
def test_what_fits_is_let_through(refused, place, value):
    """The parameters of the checkout among it, and an empty entry, which asks for nothing."""
    assert refused(place, value) is None


def test_the_smoke_ladder_is_let_through(refused, workspace, edit):
    smoke = yaml.safe_load((ROOT / "params.smoke.yaml").read_text())
    edit(workspace, lambda params: params["reload"].update(smoke["reload"]))
    assert refused("seed", 1) is None


def test_the_first_stage_asks_and_writes_nothing(workspace, edit, stage):
    edit(workspace, put("reload.sweep", {"diffusoin": [2]}))
    code, said = stage("task")
    assert code == 2 and said.startswith("task: params.yaml: reload.sweep.diffusoin"), said
    assert not (workspace / "artifacts").exists()
