"""The input of the audit: canonical order, and broken input refused."""

from dataclasses import replace

import numpy as np
import pytest
from planar import planar

from genpolicy.audit.data import AuditInput
from genpolicy.errors import ContractError, NonFiniteError


def test_broken_input_is_refused():
    data, _ = planar(episodes=10)
    action = data.action.copy()
    action[3, 0] = np.nan
    with pytest.raises(NonFiniteError, match="audit input: action"):
        replace(data, action=action)
    with pytest.raises(ContractError, match="one identifier twice"):
        replace(data, episodes=replace(data.episodes, uuid=np.full(10, "same")))
    assert isinstance(data, AuditInput)
