"""Which situations count as having modes: phases must keep them, and the place must not decide."""

from types import SimpleNamespace

import numpy as np
from planar import SETTINGS

from genpolicy.audit.situations import Situation, coherent

CHUNKS = SimpleNamespace()


def situation(phase, kept, two_mode=True, ratio=0.1):
    """One situation; `kept` is None (not measurable), True or False."""
    null = np.linspace(0.0, 0.8, 99)
    identity = None if kept is None else (1.0 if kept else 0.5, null)
    return Situation(phase, None, None, two_mode, identity, CHUNKS, ratio, 0.01)


def phases(situations):
    kept, lost = coherent(SETTINGS, tuple(situations))
    return {item.phase for item in kept if item.two_mode}, lost


def test_a_phase_in_which_few_situations_persist_loses_its_modes():
    many = [situation("approach", True)] * 9 + [situation("approach", False)]
    few = [situation("align", k < 3) for k in range(10)]
    assert phases(many + few) == ({"approach"}, 10)
    assert phases(few) == (set(), 10)


def test_a_phase_that_ends_too_soon_counts_only_alone():
    short = [situation("retreat", None)] * 8
    assert phases(short) == ({"retreat"}, 0)
    assert phases([*short, *[situation("approach", True)] * 6]) == ({"approach"}, 8)
    assert phases([*short, *[situation("align", False)] * 6]) == ({"retreat"}, 6)


def test_clusters_of_white_noise_are_no_modes():
    white = [situation("approach", True, ratio=0.9)] * 10
    assert phases(white) == (set(), 10)
    assert phases([*white, *[situation("align", True)] * 6]) == ({"align"}, 10)


def test_how_white_is_too_white_is_a_setting_and_the_ceiling_of_the_limit_on_noise():
    rough = tuple([situation("approach", True, ratio=0.3)] * 10)
    stricter = SETTINGS.model_copy(update={"white_ratio": 0.3})
    assert coherent(SETTINGS, rough)[1] == 0 and coherent(stricter, rough)[1] == 10
    assert (SETTINGS.ceilings, stricter.ceilings) == ({"noise_ratio": 0.5}, {"noise_ratio": 0.3})
