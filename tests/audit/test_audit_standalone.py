"""The audit as one value: same verdict as from the rows, and everything that it rests on."""

from dataclasses import replace

import numpy as np
import pandas as pd
import pytest
from planar import SETTINGS, admissible, named, planar

from gates.cause import Layer
from genpolicy.audit import AuditReport, audit, propose_settings
from genpolicy.audit.run import audit as audit_rows
from genpolicy.contract.normalisation import Normalisation, statistics_of
from genpolicy.data.dataset import Dataset
from genpolicy.data.frames import Frames
from genpolicy.errors import ConfigError, ContractError
from genpolicy.integrity.documents import canonical_json, parse_json

NAMES = {"ignored_channels": [], "context_channels": ["goal", "lamp"], "reference_channel": "goal"}


def dataset_of(data, *, unit="m", manifest=None):
    """The planar rows as an ingested dataset."""
    table, n = data.episodes, len(data.observation)
    channels = [
        {"name": "tcp", "components": ["x", "y"]},
        {"name": "goal", "components": ["x_m", "y_m"]},
        {"name": "lamp", "components": ["on"]},
    ]
    stored = {
        "observation_contract": {
            "channels": [
                {**c, "unit": unit if c["name"] != "lamp" else "1", "stream": "robot",
                 "maximum_age_s": 0.5} for c in channels
            ],
        },
        "action_contract": {"components": ["x", "y"], "units": [unit] * 2, "period_s": 0.1},
        **(manifest or {}),
    }  # fmt: skip
    frames = Frames(
        episode=data.episode, index=data.index, event_time_s=data.event_time_s,
        observation=data.observation, action=data.action, phase=data.phase,
        stream_event_time_s={"robot": data.event_time_s},
        stream_receive_time_s={"robot": data.event_time_s},
    )  # fmt: skip
    episodes = pd.DataFrame({
        "episode_uuid": table.uuid, "split": table.split, "operator": table.operator,
        "object": table.object, "calibration_epoch": table.calibration_epoch,
        "outcome": table.outcome, "is_recovery": table.is_recovery,
        "recorded_at_s": table.order, "rows": np.bincount(data.episode, minlength=len(table)),
    })  # fmt: skip
    assert n == len(frames)
    normalisation = Normalisation(statistics_of(data.observation), statistics_of(data.action))
    return Dataset(frames, episodes, stored, "ab" * 32, normalisation)


@pytest.fixture(scope="module")
def valid():
    return planar(episodes=120)


def test_it_says_what_the_audit_of_the_rows_says(valid):
    data, replayed = valid
    settings = SETTINGS.model_copy(update=NAMES)
    report = audit(
        dataset_of(data), settings, admissible=admissible, replay=replayed.__getitem__, root_seed=3
    )
    direct = audit_rows(
        data, settings, admissible=admissible, replay=replayed.__getitem__, root_seed=3
    )
    assert isinstance(report, AuditReport)
    cause = named(report.result, settings)
    assert cause == named(direct, settings)
    assert cause.name == "valid_modes" and cause.layer is Layer.NONE
    assert cause.confidence > 0.9
    assert len(report.modes) == 2
    document = report.as_json()
    required = {
        "modes", "support", "evidence", "rests_on", "settings", "dataset_manifest_sha256",
    }  # fmt: skip
    assert required <= set(document)
    assert not {"verdict", "confidence", "next_action"} & set(document)
    assert parse_json(canonical_json(document), where="audit.json") == document


def test_settings_are_proposed_from_units_and_pairing(valid):
    contract = {
        "pairing": {"x": "tcp.x", "y": "tcp.y"}, "labels": {"phase": "phase"},
        "audit": {"minimum_neighbours": 7, "channel_scale": {"goal": 0.02}},
    }  # fmt: skip
    settings = propose_settings(dataset_of(valid[0], manifest={"import_contract": contract}))
    assert settings.position_components == ["tcp.x", "tcp.y"]
    assert settings.action_components == ["x", "y"]
    assert settings.channel_scale["tcp"] == 0.01 and settings.channel_scale["goal"] == 0.02
    assert settings.minimum_separation_m == pytest.approx(0.03)
    assert settings.minimum_neighbours == 7
    assert settings.context_channels == ["goal", "lamp"]  # of one stream with the position
    assert not settings.phase_observed
    assert 8 <= settings.chunk_steps <= 10  # 3 x 3 cm at 1 cm a step


def test_an_unknown_unit_is_scaled_by_the_spread(valid):
    data, _ = valid
    settings = propose_settings(dataset_of(data, unit="unknown"))
    train = data.observation[(data.episodes.split == "train")[data.episode]]
    low, high = np.quantile(train[:, :2], [0.05, 0.95], axis=0)
    assert settings.channel_scale["tcp"] == pytest.approx(0.05 * (high - low).max())
    assert settings.position_components is None and settings.position_channel is None


def test_an_override_that_does_not_exist_is_refused(valid):
    contract = {"audit": {"radios": 3.0}}
    with pytest.raises(ConfigError, match=r"contract.yaml: audit.radios"):
        propose_settings(dataset_of(valid[0], manifest={"import_contract": contract}))
    settings = SETTINGS.model_copy(update={"position_channel": "elbow"})
    with pytest.raises(ContractError, match="naming the channel elbow"):
        audit(dataset_of(valid[0]), settings)


def test_it_says_what_it_rests_on(valid):
    data, _ = valid
    bare = dataset_of(data, manifest={"notes": ["tcp: unit m was guessed."]})
    for name in ("operator", "object", "calibration_epoch", "outcome"):
        bare.episodes[name] = "not_recorded"
    report = audit(bare, SETTINGS.model_copy(update=NAMES))
    text = " ".join(report.rests_on)
    assert report.rests_on[0] == "tcp: unit m was guessed."
    for what in ("operator: not recorded", "outcome: not recorded", "feasibility: not checked"):
        assert what in text
    cause = named(report.result, report.settings)
    assert (cause.name, cause.variable) == ("insufficient_support", "outcome")
    assert any(line.startswith("labels: not replayed") for line in report.evidence)


def test_what_the_body_does_is_no_context(valid):
    channels = [
        {"name": "tcp", "components": ["x", "y"], "stream": "robot"},
        {"name": "goal", "components": ["x_m", "y_m"], "stream": "camera"},
        {"name": "wrist", "components": ["phase"], "stream": "robot"},
    ]
    stored = {"channels": [{**c, "unit": "m", "maximum_age_s": 0.5} for c in channels]}
    pairs = {"import_contract": {"pairing": {"x": "tcp.x", "y": "tcp.y"}}}
    dataset = dataset_of(valid[0], manifest={"observation_contract": stored, **pairs})
    assert propose_settings(dataset).context_channels == ["goal"]
    for channel in stored["channels"]:
        channel["stream"] = "all"
    stored["channels"][2]["name"] = "gripper_opening"
    dataset = dataset_of(valid[0], manifest={"observation_contract": stored, **pairs})
    assert propose_settings(dataset).context_channels == ["goal"]


def test_progress_is_told_and_changes_nothing(valid):
    data, replayed = valid
    settings = SETTINGS.model_copy(update={**NAMES, "query_stride": 20})
    told = []
    options = {"admissible": admissible, "replay": replayed.__getitem__, "root_seed": 3}
    with_it = audit(dataset_of(data), settings, progress=lambda *a: told.append(a), **options)
    assert with_it.as_json() == audit(dataset_of(data), settings, **options).as_json()
    last = {what: (done, total) for what, done, total in told}
    assert {"situations examined", "episodes replayed"} <= set(last)
    assert all(done == total for done, total in last.values())


def test_what_was_noticed_but_is_no_defect_is_said(valid):
    data, _ = valid
    late = 0.05 * (data.episodes.order > 80)[data.episode][:, None]
    wandering = data.observation + np.hstack([late, late, np.zeros((len(late), 3))])
    commanded = data.action + late
    moved = replace(data, observation=wandering, action=commanded)
    report = audit(dataset_of(moved), SETTINGS.model_copy(update={**NAMES, "query_stride": 20}))
    assert any("Starts wander" in line for line in report.rests_on)
