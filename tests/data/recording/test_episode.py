"""A recorded episode: lengths agree, samples are read-only copies."""

from dataclasses import replace

import numpy as np
import pytest

from genpolicy.data.recording.episode import StreamSamples
from genpolicy.errors import ContractError


def test_samples_must_agree_in_length():
    with pytest.raises(ContractError, match="one row per sample"):
        StreamSamples("s", np.arange(3), np.arange(2), np.zeros((3, 1)))


def test_samples_are_read_only_copies(factory):
    samples = factory.episode(0).streams["robot"]
    with pytest.raises(ValueError, match="read-only"):
        samples.values[0, 0] = 1.0
    source = np.zeros((2, 1))
    copy = StreamSamples("s", np.arange(2), np.arange(2), source)
    source[:] = 7.0
    assert replace(copy).values.max() == 0.0
