"""Edits of evidence, cell by cell."""

import numpy as np


def cells(column, value, *, where=None, share=1.0):
    """Set `share` of the chosen rows of a column, spread evenly so that all clusters are hit."""

    def change(frame):
        mask = np.ones(len(frame), bool) if where is None else where(frame).to_numpy()
        chosen = np.flatnonzero(mask)
        chosen = chosen[: max(1, int(np.ceil(share * len(chosen))))]
        series = frame[column].astype(object)
        series.iloc[chosen] = value
        frame[column] = series.tolist()
        return frame

    return change
