"""The data with every measured offset of a clock taken out, so that modes can be counted again."""

from dataclasses import replace

import numpy as np

from genpolicy.audit.data import AuditInput
from genpolicy.audit.semantics.report import Clock


def realigned(data: AuditInput, clocks: tuple[Clock, ...]) -> tuple[AuditInput, bool]:
    """Actions moved by the whole steps by which their epoch's position stream is off.

    Returns:
        The data and whether anything moved.
    """
    shift = np.zeros(len(data.episodes), dtype=np.int64)
    for clock in clocks:
        if clock.stream == data.position_stream and clock.offset_before_s is not None:
            steps = round(clock.offset_before_s / data.period_s)
            shift[data.episodes.calibration_epoch == clock.epoch] = steps
    if not shift.any():
        return data, False
    rows = np.arange(len(data.action)) - shift[data.episode]
    rows = np.clip(rows, data.first_row, data.last_row)
    return replace(data, action=data.action[rows]), True
