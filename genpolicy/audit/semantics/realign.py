"""The data with every measured offset of a clock taken out, so that modes can be counted again."""

from dataclasses import replace

import numpy as np

from genpolicy.audit.data import AuditInput, Integers
from genpolicy.audit.semantics.report import Semantics


def realigned(data: AuditInput, semantics: Semantics) -> tuple[AuditInput, bool]:
    """Actions, and columns of other streams, moved by the rows by which their clock is off.

    Returns:
        The data and whether anything moved.
    """
    moved = False
    shift = semantics.shift_rows
    if shift.size and shift.any():
        data, moved = replace(data, action=data.action[_rows(data, -shift)]), True
    for name, late in semantics.stream_shift_rows.items():
        if name in data.streams and late.any():
            observation = data.observation.copy()
            columns = np.arange(observation.shape[1])[data.streams[name]]
            observation[:, columns] = observation[_rows(data, late)][:, columns]
            data, moved = replace(data, observation=observation), True
    return data, moved


def _rows(data: AuditInput, later: Integers) -> Integers:
    """The row that comes `later` rows after each, inside its episode. Shape (N,)."""
    rows = np.arange(len(data.action)) + later[data.episode]
    return np.asarray(np.clip(rows, data.first_row, data.last_row), dtype=np.int64)
