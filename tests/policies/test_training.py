"""Training: bytes per seed, matched batches, masks, schedules, counts, horizons."""

import dataclasses
import json

import numpy as np
import pytest
import torch

from genpolicy.errors import ConfigError, ContractError, NonFiniteError
from genpolicy.integrity.rows import read_rows
from genpolicy.policies.checkpoint import load_checkpoint
from genpolicy.policies.methods import METHODS
from genpolicy.policies.objectives import Batch
from genpolicy.policies.settings import TrainingConfig
from genpolicy.policies.training import averaging_decay, learning_rate, train
from genpolicy.policies.validation_row import EARLIER_FOLDER, VALIDATION_FILE, ValidationRow
from genpolicy.policies.windows import Windows


@pytest.mark.parametrize("method", list(METHODS))
def test_same_seed_same_bytes_other_seed_other_bytes(
    tmp_path, folders, method, request_for, two_mode_windows, train_with_teacher
):
    windows = two_mode_windows()
    torch.manual_seed(99)
    np.random.seed(99)
    for name, request in (("again", request_for(method)), ("other", request_for(method, seed=4))):
        train_with_teacher(tmp_path / name, request, windows=windows, validation=windows)
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


@pytest.mark.parametrize("method", list(METHODS))
def test_every_loss_learns(tmp_path, method, request_for, two_mode_windows, train_with_teacher):
    windows, request = two_mode_windows(), request_for(method, updates=60)
    train_with_teacher(tmp_path / "run", request, windows=windows, validation=windows)
    lines = [
        json.loads(line) for line in (tmp_path / "run" / "metrics.jsonl").read_text().splitlines()
    ]
    assert [line["updates"] for line in lines] == [10, 20, 30, 40, 50, 60]
    assert lines[-1]["training_loss"] < lines[0]["training_loss"]
    record = json.loads((tmp_path / "run" / "training.json").read_text())
    assert record["stopping_rule"] == "fixed number of updates"
    assert record["final"]["validation_loss"] > 0.0


def test_schedules():
    config = TrainingConfig(updates=100, warmup_updates=10, learning_rate=1e-3)
    rates = [learning_rate(update, config) for update in range(100)]
    assert rates[9] == pytest.approx(1e-3)
    assert np.all(np.diff(rates[:10]) > 0)
    assert np.all(np.diff(rates[10:]) < 0)
    assert averaging_decay(0, config) == 0.0
    assert averaging_decay(15, config) == pytest.approx(1 - 16**-0.75)
    assert averaging_decay(10**9, config) == config.ema_cap


def test_following_the_validation_changes_no_weight_and_is_paired(
    tmp_path, request_for, two_mode_windows
):
    """The same windows and noise at three quarters and at the end; without it, the same bytes."""
    windows, request = two_mode_windows(), request_for("flow", updates=30)
    names = np.array([f"e{row % 3}" for row in range(len(windows.actions))])
    named = dataclasses.replace(windows, episodes=names)
    train(tmp_path / "followed", request, windows=windows, validation=named)
    train(tmp_path / "alone", request, windows=windows)
    weights = [(tmp_path / n / "model.safetensors").read_bytes() for n in ("followed", "alone")]
    assert weights[0] == weights[1]
    assert not (tmp_path / "alone" / VALIDATION_FILE).exists()
    rows = read_rows(tmp_path / "followed" / VALIDATION_FILE, ValidationRow)
    assert [(row.updates, row.episode_uuid) for row in rows] == [
        (count, f"e{e}") for count in (10, 20, 23, 30) for e in range(3)
    ]
    assert {row.windows for row in rows} == {32}
    assert not (tmp_path / "followed" / EARLIER_FOLDER).exists()
    lines = (tmp_path / "followed" / "metrics.jsonl").read_text().splitlines()
    assert [json.loads(line)["updates"] for line in lines] == [10, 20, 30]


def test_the_earlier_weights_are_those_of_three_quarters_and_change_nothing(
    tmp_path, request_for, two_mode_windows
):
    """A checkpoint of its own below the result, whose bytes are the same without it."""
    windows, request = two_mode_windows(), request_for("flow", updates=30)
    train(tmp_path / "plain", request, windows=windows, validation=windows)
    kept = dataclasses.replace(request, keep_earlier=True)
    train(tmp_path / "kept", kept, windows=windows, validation=windows)
    files = {"model.safetensors", "config.json", "training.json", "metrics.jsonl"}
    for name in files:
        assert (tmp_path / "kept" / name).read_bytes() == (tmp_path / "plain" / name).read_bytes()
    result, earlier = (load_checkpoint(tmp_path / "kept" / part) for part in (".", EARLIER_FOLDER))
    assert result.sha256 != earlier.sha256
    assert {p.name for p in (tmp_path / "kept" / EARLIER_FOLDER).iterdir()} == {
        "model.safetensors", "config.json",
    }  # fmt: skip


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


def test_trainings_of_one_method_are_told_apart_while_they_run(
    monkeypatch, capsys, tmp_path, request_for, two_mode_windows
):
    """Variants and seeds of a method run side by side, and their lines come mixed."""
    monkeypatch.setattr("genpolicy.progress.LOG_EVERY_S", 0.0)
    for variant in ("reference", "longer_history"):
        (tmp_path / variant).mkdir()
        train(tmp_path / variant / "seed_4", request_for("bc"), windows=two_mode_windows())
    said = capsys.readouterr().err
    assert {line.split(":")[0] for line in said.splitlines()} == {
        "reference/seed_4, update",
        "longer_history/seed_4, update",
    }
