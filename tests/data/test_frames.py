"""Frames of a dataset: rows are taken from every column alike."""

from dataclasses import fields

import numpy as np

from genpolicy.data.frames import Frames


def test_every_column_keeps_the_same_rows() -> None:
    row = np.arange(6)
    columns = {item.name: row for item in fields(Frames)}
    for name in ("stream_event_time_s", "stream_receive_time_s"):
        columns[name] = {"camera": row, "force": row}
    keep = np.array([4, 1])
    kept = Frames(**columns).rows(keep)
    assert len(kept) == 2
    for item in fields(Frames):
        found = getattr(kept, item.name)
        for column in found.values() if isinstance(found, dict) else [found]:
            np.testing.assert_array_equal(column, keep)
