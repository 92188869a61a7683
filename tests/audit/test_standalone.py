"""The audit as one value: same verdict as from the rows, and everything that it rests on."""

from dataclasses import replace

import numpy as np
import pytest
from planar import SETTINGS, admissible, named, planar
from planar_dataset import dataset_of

from gates.cause import Topic
from genpolicy.audit import AuditReport, audit
from genpolicy.audit.run import audit as audit_rows
from genpolicy.integrity.documents import canonical_json, parse_json

NAMES = {"ignored_channels": [], "context_channels": ["goal", "lamp"], "reference_channel": "goal"}


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
    assert cause.name == "valid_modes" and cause.topic is Topic.NONE
    # Some draws leave open what is told: 150 episodes are not many to deny it.
    assert cause.agreeing[0] > 0.69 * cause.agreeing[1]
    assert len(report.modes) == 2
    document = report.as_json()
    required = {
        "modes", "support", "evidence", "rests_on", "settings", "dataset_manifest_sha256",
    }  # fmt: skip
    assert required <= set(document)
    assert not {"verdict", "confidence", "next_action"} & set(document)
    assert parse_json(canonical_json(document), where="audit.json") == document


def test_it_says_what_it_rests_on(valid):
    data, _ = valid
    bare = dataset_of(data, manifest={"notes": ["tcp: unit m was guessed."]})
    for name in ("operator", "object", "calibration_epoch", "outcome"):
        bare.episodes[name] = "not_recorded"
    report = audit(bare, SETTINGS.model_copy(update=NAMES))
    text = " ".join(report.rests_on)
    assert report.rests_on[0] == "tcp: unit m was guessed."
    for what in (
        "operator (not recorded",
        "outcome: not recorded",
        "feasibility (neither",
        "labels (no episode",
    ):
        assert what in text
    cause = named(report.result, report.settings)
    assert (cause.name, cause.variable) == ("insufficient_support", "outcome")
    assert any(line.startswith("labels: not replayed") for line in report.evidence)


def test_what_was_noticed_but_is_no_defect_is_said(valid):
    data, _ = valid
    late = 0.05 * (data.episodes.order > 80)[data.episode][:, None]
    wandering = data.observation + np.hstack([late, late, np.zeros((len(late), 3))])
    commanded = data.action + late
    moved = replace(data, observation=wandering, action=commanded)
    report = audit(dataset_of(moved), SETTINGS.model_copy(update={**NAMES, "query_stride": 20}))
    assert any("Starts wander" in line for line in report.rests_on)
