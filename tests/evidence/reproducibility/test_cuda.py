"""Gate B's evidence of checkpoints that a CUDA device trained and draws; skipped where none is."""

import pandas as pd
import pytest
import torch

from genpolicy.candidates.judged import trained
from genpolicy.contract.latency import MEASURED_TERMS
from genpolicy.evidence.documents.reproducibility import CANDIDATES
from genpolicy.evidence.reproducibility.identity import Deployment
from genpolicy.evidence.reproducibility.latency import LatencyPlan, measure_all
from genpolicy.evidence.reproducibility.reload import ReloadPlan, write_reload
from genpolicy.evidence.rows.need import ModeRow
from genpolicy.evidence.rows.reproducibility import VARIATIONS, SampleRow, VariationRow
from genpolicy.integrity.rows import read_rows, write_rows
from genpolicy.policies.fixtures import FixtureRow, fixture_observations, fixture_rows
from genpolicy.policies.matched_training import TrainingPlan, train_methods
from genpolicy.policies.policy import load_policy
from genpolicy.policies.settings import SamplerConfig

DEVICE = "cuda"
pytestmark = pytest.mark.skipif(
    not torch.cuda.is_available(), reason="torch finds no CUDA device on this machine"
)

METHODS = {
    "flow": SamplerConfig(name="euler", steps=2),
    "diffusion": SamplerConfig(name="ddim", steps=4),
}


@pytest.fixture(scope="module")
def there(dataset, kit, tmp_path_factory):
    """Checkpoints of the device, and the fixtures of their training."""
    root = tmp_path_factory.mktemp("there")
    plan = TrainingPlan(
        dataset=dataset, settings=kit.POLICY, horizons=kit.HORIZONS, root_seed=1, device=DEVICE,
        workers=1, scheduler="local", keep_earlier=True,
    )  # fmt: skip
    train_methods(plan, METHODS, folder=root)
    return root, trained(root, list(METHODS), seeds=[0], device=DEVICE)


@pytest.fixture(scope="module")
def reloaded(there, dataset, data, kit):
    root, candidates = there
    plan = ReloadPlan(
        task="tabletop_insertion", feasibility=kit.FEASIBILITY, dataset=dataset,
        audit=kit.write_situations(root / "audit", [(n, 4, {}) for n in kit.uuids(data)[8:]]),
        samples=3, deployment=Deployment(
            kit.HORIZONS, deadline_s=0.15, samples=4, replan_lead_rows=3
        ),
        root_seed=3,
        sweep={"flow": [1, SamplerConfig(name="midpoint")]},
    )  # fmt: skip
    seen = fixture_observations(data, horizons=kit.HORIZONS, count=3)
    rows = [
        row
        for one in candidates
        for row in fixture_rows(load_policy(one.folder), seen, method=one.name, seed=0)
    ]
    write_rows(root / "fixtures.parquet", FixtureRow, rows)
    (root / "out").mkdir()
    write_reload(plan, candidates, root / "fixtures.parquet", root / "out")
    return root / "out"


def test_what_comes_back_is_equal_on_either_device(reloaded):
    samples = read_rows(reloaded / "samples.parquet", SampleRow)
    assert {(row.method, row.device, row.max_abs_difference) for row in samples} == {
        (method, device, 0.0) for method in METHODS for device in ("cpu", DEVICE)
    }
    assert len(samples) == 2 * 2 * 3


def test_no_way_of_asking_changes_a_bit_there(reloaded):
    varied = read_rows(reloaded / "variations.parquet", VariationRow)
    assert {(row.method, row.variation, row.unequal, row.max_abs_difference) for row in varied} == {
        (method, way, 0, 0.0) for method in METHODS for way in VARIATIONS
    }


def test_the_card_says_where_it_ran_and_the_rest_of_the_evidence_is_there(reloaded):
    cards = CANDIDATES.read(reloaded)
    assert {(name, card.card.device) for name, card in cards.items()} == {
        (method, DEVICE) for method in METHODS
    }
    assert {card.metadata_mismatches + card.nonfinite_weights for card in cards.values()} == {0}
    assert {row.method for row in read_rows(reloaded / "modes.parquet", ModeRow)} == {*METHODS}


def test_latencies_are_those_of_the_device(there, dataset, kit):
    plan = LatencyPlan(
        dataset=dataset, task="tabletop_insertion", feasibility=kit.FEASIBILITY,
        horizons=kit.HORIZONS, samples=2, warm=10, cold=1,
    )  # fmt: skip
    rows = pd.DataFrame([vars(row) for row in measure_all(plan, there[1][:1]).rows])
    own = rows[(rows["source"] == "measured") & (rows["temperature"] == "warm")]
    assert {*own["component"]} == {*MEASURED_TERMS} and (own["seconds"] > 0.0).all()
