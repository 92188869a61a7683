"""The observation: ordered channels, one vector, one hash, and refusals by name."""

import hashlib
import json
from dataclasses import asdict, replace

import numpy as np
import pytest

from genpolicy.contract.observation import Channel, ObservationContract
from genpolicy.errors import ContractError

JOINTS = Channel("q_rad", ("a", "b"), "rad", "joints", 0.05)
FORCE = Channel("force_n", ("x", "y", "z"), "N", "wrench", 0.02)
SPEED = Channel("dq_rad_s", ("a", "b"), "rad/s", "joints", 0.05)
CONTRACT = ObservationContract((JOINTS, FORCE, SPEED))
VALUES = {"q_rad": np.array([1.0, 2.0]), "force_n": np.array([3.0, 4.0, 5.0]),
          "dq_rad_s": np.array([6.0, 7.0])}  # fmt: skip


def test_what_is_joined_lies_where_the_slices_say():
    joined = CONTRACT.join(dict(reversed(VALUES.items())))
    np.testing.assert_array_equal(joined, np.arange(1.0, 8.0))
    for name, part in CONTRACT.slices.items():
        np.testing.assert_array_equal(joined[part], VALUES[name])
    assert CONTRACT.dim == len(joined) == len(CONTRACT.component_names)
    assert CONTRACT.component_names[:3] == ("q_rad.a", "q_rad.b", "force_n.x")
    assert CONTRACT.streams == ("joints", "wrench")


def test_a_manifest_gives_back_what_it_was_written_from():
    stored = json.loads(json.dumps([asdict(channel) for channel in CONTRACT.channels]))
    assert ObservationContract.of_document(stored) == CONTRACT
    assert ObservationContract.of_document(stored[::-1]).hash() != CONTRACT.hash()


def test_leading_axes_stay():
    many = {name: np.broadcast_to(value, (5, 4, len(value))) for name, value in VALUES.items()}
    assert CONTRACT.join(many).shape == (5, 4, CONTRACT.dim)


@pytest.mark.parametrize(
    ("values", "text"),
    [
        ({k: v for k, v in VALUES.items() if k != "force_n"}, "expected exactly"),
        ({**VALUES, "odd": np.zeros(1)}, r"made of the channels .*'odd'"),
        ({**VALUES, "force_n": np.zeros(2)}, r"channel force_n is of shape \(2,\), .* axis of 3"),
        ({**VALUES, "q_rad": np.float64(1.0)}, r"channel q_rad is of shape \(\), .* axis of 2"),
    ],
)
def test_what_does_not_fit_is_named(values, text):
    with pytest.raises(ContractError, match=text):
        CONTRACT.join(values)


@pytest.mark.parametrize(
    "change",
    [{"name": "q2_rad"}, {"components": ("b", "a")}, {"unit": "1"}, {"stream": "other"},
     {"maximum_age_s": 0.1}],
    ids=lambda change: next(iter(change)),
)  # fmt: skip
def test_every_field_is_in_the_hash(change):
    other = ObservationContract((replace(JOINTS, **change), FORCE, SPEED))
    assert other.hash() != CONTRACT.hash()


def test_the_hash_is_that_of_the_definition_and_its_order():
    """Golden: the document, written out, keys in order."""
    document = """[
  {
    "components": [
      "x",
      "y",
      "z"
    ],
    "maximum_age_s": 0.02,
    "name": "force_n",
    "stream": "wrench",
    "unit": "N"
  }
]
"""
    one, two = ObservationContract((FORCE, JOINTS)), ObservationContract((JOINTS, FORCE))
    assert ObservationContract((FORCE,)).hash() == hashlib.sha256(document.encode()).hexdigest()
    assert one.hash() != two.hash()
