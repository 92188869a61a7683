"""A test of a latent that its checkpoint does not give is refused, and so is one that lacks."""

from dataclasses import fields, replace

import pytest

from gates.rederive_latent import rederive_latent
from gates.rederive_measured import Bench
from genpolicy.candidates.judged import sampling_by
from genpolicy.data.dataset import load_dataset
from genpolicy.errors import RefusedError
from genpolicy.evidence.documents.need import LATENT, Dependence, LatentDependence
from genpolicy.evidence.need.held_out import held_out_situations
from genpolicy.evidence.need.latent import latent_dependence
from genpolicy.policies.policy import load_policy
from genpolicy.policies.settings import SamplerConfig

DRAWN = SamplerConfig(name="euler", steps=2)
SITUATIONS, SAMPLES, PERMUTATIONS = 4, 3, 199


@pytest.fixture(scope="module")
def audit(data, kit, tmp_path_factory):
    rows = [(uuid, 3, {}) for uuid in kit.uuids(data)[-SITUATIONS:]]
    return kit.write_situations(tmp_path_factory.mktemp("latent") / "audit", rows)


@pytest.fixture(scope="module")
def true(fleet, dataset, audit, kit):
    """The flow stands in for a policy with a latent: what it draws is its noise."""
    policy = sampling_by(load_policy(fleet[0] / "flow" / "seed_0"), DRAWN)
    held_out = held_out_situations(audit, load_dataset(dataset), horizons=kit.HORIZONS)
    found = latent_dependence(
        policy, held_out, samples=SAMPLES, permutations=PERMUTATIONS, root_seed=kit.PARAMS["seed"]
    )
    assert found.situations == SITUATIONS and 0 < found.exceeding < PERMUTATIONS
    return LatentDependence(**vars(found), method="flow", convention="drawn", seed=0)


@pytest.fixture
def holds(tmp_path, fleet, dataset, audit, kit):
    artifacts = tmp_path / "artifacts"
    (artifacts / "measure_baselines").mkdir(parents=True)
    (artifacts / "train_baselines").mkdir()
    (artifacts / "train_baselines/flow").symlink_to(fleet[0] / "flow")
    (artifacts / "ingest").symlink_to(dataset)
    (artifacts / "audit").symlink_to(audit)
    test = {"method": "flow", "convention": "drawn", "permutations": PERMUTATIONS}
    sections = ("horizons", "feasibility", "task", "seed", "compute")
    params = {
        **{name: kit.PARAMS[name] for name in sections},
        "policy": {"seeds": [0]},
        "measure_baselines": {"samples": SAMPLES, "latent": test,
                              "conventions": {"flow": {"drawn": DRAWN.model_dump()}}},
    }  # fmt: skip

    def holds(*entries, latent=test):
        LATENT.write(artifacts / "measure_baselines", list(entries))
        params["measure_baselines"]["latent"] = latent
        rederive_latent(Bench.of("A", tmp_path, params))

    return holds


def test_the_true_test_is_found_again(holds, true):
    holds(true)


@pytest.mark.parametrize("name", [field.name for field in fields(Dependence)])
def test_a_number_that_is_not_found_again_is_refused_by_name(holds, true, name):
    value = getattr(true, name)
    forged = replace(true, **{name: value + 1 if isinstance(value, int) else value * 1.01})
    with pytest.raises(RefusedError, match=rf"flow \(seed 0\) by drawn: {name} is"):
        holds(forged)


def test_what_another_processor_may_round_is_no_forgery(holds, true):
    holds(replace(true, spread_m=true.spread_m * (1 + 1e-4)))


def test_each_training_is_tested_once_and_nobody_else(holds, true):
    with pytest.raises(RefusedError, match="not tested"):
        holds()
    with pytest.raises(RefusedError, match="tested twice"):
        holds(true, true)
    for changes in ({"method": "act"}, {"seed": 1}, {"convention": "other"}):
        with pytest.raises(RefusedError, match="plans another or none"):
            holds(true, replace(true, **changes))
    with pytest.raises(RefusedError, match="plans another or none"):
        holds(true, latent=None)
    holds(latent=None)
