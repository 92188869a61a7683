"""Figures of Gate C: what stands after each layer, and how far projection moved it."""

import evidence
import numpy as np
import pytest

from gates.evidence import Evidence
from gates.feasibility.candidates import admissible
from gates.feasibility.settings import CANDIDATES, HELD_OUT, LAYERS
from gates.pages.figures import draw_all
from gates.pages.plots_feasibility import PLOTS
from genpolicy.evidence.rows.shadow import CandidateRow

TABLE = CANDIDATES.removeprefix("artifacts/")


def _falls(root, judged):
    """Held-out observations: share standing after each layer, by method."""
    axes = PLOTS[0].draw(Evidence(root), judged("C")).axes[0]
    return {c.get_label(): [bar.get_height() for bar in c] for c in axes.containers}


def test_the_waterfall_never_rises_and_ends_at_the_admissible_share(copied, judged):
    evidence.edit_table(
        copied, TABLE,
        lambda f: f.assign(geometric=f["observation"] % 3 > 0, kinematic=f["observation"] % 2 > 0),
    )  # fmt: skip
    frame = Evidence(copied).rows(CANDIDATES, CandidateRow)
    for method, shares in _falls(copied, judged).items():
        rows = frame[(frame["fixture"] == HELD_OUT) & (frame["method"] == method)]
        assert len(shares) == len(LAYERS) + 1 and shares[0] == 1.0
        assert np.all(np.diff(shares) <= 0)
        assert shares[-1] == pytest.approx(admissible(rows).mean()) and 0 < shares[-1] < 0.5


def test_what_fell_stays_fallen(copied, judged):
    """Whoever the first layer refuses does not stand again behind a later one that passes it."""
    evidence.edit_table(copied, TABLE, lambda f: f.assign(**{LAYERS[0]: False}))
    assert all(shares[1:] == [0.0] * len(LAYERS) for shares in _falls(copied, judged).values())


def test_a_curve_counts_the_admissible_chunks_alone(copied, judged):
    evidence.edit_table(copied, TABLE, lambda f: f.assign(geometric=False))
    pictures = draw_all(PLOTS, Evidence(copied), judged("C"))
    said = "no admissible held-out candidate"
    assert [picture.skipped for picture in pictures] == ["", said, said]
