"""The test of the strata: its error over the family, by simulation."""

import numpy as np
from planar import SETTINGS, planar

from genpolicy.audit.data import canonical
from genpolicy.audit.linking import link
from genpolicy.audit.situations import find_situations
from genpolicy.audit.strata import examine_strata


def test_family_wise_error_of_the_strata_test():
    wrong = 0
    for seed in range(40):
        data = canonical(planar(episodes=80, seed=100 + seed)[0])
        settings = SETTINGS.model_copy(update={"query_stride": 40})
        several = [(i, c) for _, i, c in find_situations(data, settings, seed)[0] if c.count > 1]
        members = [(data.episode[item.members], split.labels) for item, split in several]
        links = {"approach": link(members, len(data.episodes), 6)}
        rows = examine_strata(data, settings, {"approach": several}, links, root_seed=seed)
        assert {"history", "recording_sequence", "operator"} <= {row.variable for row in rows}
        wrong += any(r.p_adjusted is not None and r.p_adjusted <= 0.05 for r in rows)
    assert wrong / 40 <= 0.05 + 3 * np.sqrt(0.05 * 0.95 / 40)
