"""Training: bytes per seed, matched batches, masks, schedules, counts, horizons."""

import dataclasses
import json

import numpy as np
import pytest
import torch

from genpolicy.contract.horizons import HorizonConfig
from genpolicy.contract.settings import parse_settings
from genpolicy.errors import ConfigError, ContractError, NonFiniteError
from genpolicy.policies.checkpoint import load_checkpoint
from genpolicy.policies.determinism import deterministic
from genpolicy.policies.methods import METHODS, method_named
from genpolicy.policies.networks import (
    Dimensions,
    flops_per_evaluation,
    parameter_counts,
)
from genpolicy.policies.normalisation import MinMax, Normalisation
from genpolicy.policies.objectives import Batch, masked_mean
from genpolicy.policies.settings import HeadConfig, NetworkConfig, TrainingConfig
from genpolicy.policies.training import averaging_decay, learning_rate, train
from genpolicy.policies.windows import Windows


@pytest.mark.parametrize("method", list(METHODS))
def test_same_seed_same_bytes_other_seed_other_bytes(
    tmp_path, folders, method, request_for, two_mode_windows
):
    windows = two_mode_windows()
    torch.manual_seed(99)
    np.random.seed(99)
    train(tmp_path / "again", request_for(method), windows=windows, validation=windows)
    train(tmp_path / "other", request_for(method, seed=4), windows=windows, validation=windows)
    for name in ("model.safetensors", "config.json", "training.json", "metrics.jsonl"):
        first = (folders[method] / name).read_bytes()
        assert (tmp_path / "again" / name).read_bytes() == first
        assert (tmp_path / "other" / name).read_bytes() != first


def test_padded_actions_do_not_move_the_loss(tmp_path, request_for, two_mode_windows):
    windows = two_mode_windows()
    changed = windows.actions.copy()
    changed[windows.is_pad] += 0.3
    other = Windows(windows.observations, changed, windows.is_pad)
    unmasked = request_for("chunked_bc")
    unmasked = dataclasses.replace(
        unmasked, training=unmasked.training.model_copy(update={"mask_padding": False})
    )
    for request, equal in ((request_for("chunked_bc"), True), (unmasked, False)):
        for name, data in (("one", windows), ("two", other)):
            train(tmp_path / name, request, windows=data)
        one, two = ((tmp_path / n / "model.safetensors").read_bytes() for n in ("one", "two"))
        assert (one == two) is equal


def test_masked_mean_counts_only_weighted_entries():
    values = torch.tensor([[[1.0, 3.0], [100.0, 100.0]]])
    assert float(masked_mean(values, torch.tensor([[[1.0], [0.0]]]))) == 2.0


@pytest.mark.parametrize("method", list(METHODS))
def test_every_loss_learns(tmp_path, method, request_for, two_mode_windows):
    windows = two_mode_windows()
    train(tmp_path / "run", request_for(method, steps=60), windows=windows, validation=windows)
    lines = [
        json.loads(line) for line in (tmp_path / "run" / "metrics.jsonl").read_text().splitlines()
    ]
    assert [line["step"] for line in lines] == [10, 20, 30, 40, 50, 60]
    assert lines[-1]["training_loss"] < lines[0]["training_loss"]
    record = json.loads((tmp_path / "run" / "training.json").read_text())
    assert record["stopping_rule"] == "fixed number of steps"
    assert record["final"]["validation_loss"] > 0.0


def test_heads_fill_one_budget():
    network, head = NetworkConfig(), HeadConfig()
    totals, encoders, trunks = [], set(), set()
    for method in METHODS.values():
        horizon = 16 if method.chunked else 1
        dimensions = Dimensions(
            observation_horizon=2, observation_dim=24, prediction_horizon=horizon, action_dim=10
        )
        counts = parameter_counts(method.build(dimensions, network, head))
        assert abs(counts["head"] - network.head_parameters) <= 0.05 * network.head_parameters
        assert flops_per_evaluation(method.build(dimensions, network, head))["total"] < 2.2e6
        totals.append(counts["total"])
        encoders.add(counts["encoder"])
        trunks.add(counts["trunk"])
    assert len(encoders) == len(trunks) == 1
    assert max(totals) - min(totals) <= 0.01 * max(totals)
    assert 0.9e6 < totals[0] < 1.2e6


def test_a_budget_too_small_for_a_head_is_refused():
    dimensions = Dimensions(
        observation_horizon=2, observation_dim=24, prediction_horizon=16, action_dim=10
    )
    with pytest.raises(ConfigError, match="head_parameters"):
        METHODS["flow"].build(dimensions, NetworkConfig(head_parameters=1000), HeadConfig())


def test_schedules():
    config = TrainingConfig(steps=100, warmup_steps=10, learning_rate=1e-3)
    rates = [learning_rate(step, config) for step in range(100)]
    assert rates[9] == pytest.approx(1e-3)
    assert np.all(np.diff(rates[:10]) > 0)
    assert np.all(np.diff(rates[10:]) < 0)
    assert averaging_decay(0, config) == 0.0
    assert averaging_decay(15, config) == pytest.approx(1 - 16**-0.75)
    assert averaging_decay(10**9, config) == config.ema_cap


def test_horizons():
    good = {"observation_horizon": 2, "prediction_horizon": 16, "execution_horizon": 8}
    horizons = HorizonConfig(**good, action_period_s=0.05)
    assert method_named("bc").horizons(horizons).prediction_horizon == 1
    assert method_named("flow").horizons(horizons) is horizons
    for change, field in (
        ({"execution_horizon": 17}, "prediction_horizon"),
        ({"observation_horizon": 0}, "observation_horizon"),
        ({"execution_horizon": 0}, "execution_horizon"),
        ({"action_period_s": "0.05"}, "action_period_s"),
        ({"action_period_s": float("nan")}, "action_period_s"),
        ({"surprise": 1}, "surprise"),
    ):
        with pytest.raises(ConfigError, match=field):
            parse_settings(
                HorizonConfig, {**good, "action_period_s": 0.05, **change}, where="horizons"
            )


def test_an_unknown_method_and_wrong_windows_are_refused(tmp_path, request_for, two_mode_windows):
    windows = two_mode_windows()
    with pytest.raises(ConfigError, match="registered method"):
        train(
            tmp_path / "x",
            dataclasses.replace(request_for("flow"), method="os.system"),
            windows=windows,
        )
    short = Windows(windows.observations, windows.actions[:, :3], windows.is_pad[:, :3])
    with pytest.raises(ContractError, match="3 actions"):
        train(tmp_path / "x", request_for("flow"), windows=short)
    with pytest.raises(NonFiniteError, match="actions"):
        Windows(windows.observations, windows.actions * np.nan, windows.is_pad)
    assert not (tmp_path / "x").exists()


def test_a_diverging_training_writes_nothing(tmp_path, request_for, two_mode_windows):
    request = request_for("bc")
    request = dataclasses.replace(
        request, training=request.training.model_copy(update={"learning_rate": 1e30})
    )
    with pytest.raises(NonFiniteError, match="loss of bc"):
        train(tmp_path / "x", request, windows=two_mode_windows())
    assert not (tmp_path / "x").exists()


def test_normalisation_round_trip_and_constants():
    rng = np.random.default_rng(0)
    values = rng.normal(0.0, 3.0, (50, 4))
    values[:, 2] = 0.7
    statistics = MinMax(values.min(0), values.max(0))
    normalised = statistics.normalise(values)
    assert np.all(normalised[:, 2] == 0.0)
    assert np.abs(normalised).max() == pytest.approx(1.0)
    np.testing.assert_allclose(statistics.denormalise(normalised), values, atol=1e-9)
    both = Normalisation(statistics, statistics)
    copy = Normalisation.from_json(json.loads(json.dumps(both.as_json())))
    assert np.array_equal(copy.action.minimum, statistics.minimum)
    with pytest.raises(NonFiniteError):
        MinMax(np.array([np.nan]), np.array([1.0]))
    with pytest.raises(ContractError):
        Normalisation.from_json({"observation": {}})


def test_batches_are_matched_over_methods(monkeypatch, tmp_path, request_for, two_mode_windows):
    seen: dict[str, list[bytes]] = {}
    for method in ("chunked_bc", "flow"):
        rows = seen.setdefault(method, [])

        def record(observations, actions, weight, rows=rows):
            rows.append(observations.numpy().tobytes())
            return Batch(observations, actions, weight)

        monkeypatch.setattr("genpolicy.policies.training.Batch", record)
        train(tmp_path / method, request_for(method), windows=two_mode_windows())
    assert len(seen["flow"]) == 20
    assert seen["chunked_bc"] == seen["flow"]


@pytest.mark.parametrize("method", list(METHODS))
@pytest.mark.parametrize("rows", [8, 16, 64])
def test_a_row_keeps_its_bits_at_every_place_of_a_batch(method, rows):
    dimensions = Dimensions(
        observation_horizon=2,
        observation_dim=24,
        prediction_horizon=16 if METHODS[method].chunked else 1,
        action_dim=10,
    )
    generator = torch.Generator().manual_seed(1)
    network = METHODS[method].build(dimensions, NetworkConfig(), HeadConfig())
    observations = torch.randn(1, 2, 24, generator=generator).expand(rows, -1, -1).contiguous()
    reads = METHODS[method].reads
    values = time = None
    if reads == "latent":
        values = (
            torch.randn(1, HeadConfig().latent_dim, generator=generator)
            .expand(rows, -1)
            .contiguous()
        )
    elif reads == "chunk":
        values = torch.randn(1, 16, 10, generator=generator).expand(rows, -1, -1).contiguous()
        time = torch.full((rows,), 0.37)
    elif reads == "codes":
        values = torch.randn(1, 32, HeadConfig().code_dim, generator=generator)
        values = values.expand(rows, -1, -1).contiguous()
    with deterministic("cpu"), torch.inference_mode():
        out = network.evaluate(network.encode(observations), values, time)
    assert all(torch.equal(out[0], row) for row in out)


def test_cvae_is_act_drawn_from_its_prior(folders):
    act, cvae = (load_checkpoint(folders[name]) for name in ("act", "cvae"))
    assert act.config.method != cvae.config.method
    weights = cvae.network.state_dict()
    assert all(torch.equal(weights[k], v) for k, v in act.network.state_dict().items())
