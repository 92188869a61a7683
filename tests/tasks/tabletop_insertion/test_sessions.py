from dataclasses import asdict

import numpy as np
import pytest
from scipy.stats import chi2_contingency

from genpolicy.errors import ConfigError
from genpolicy.tasks.tabletop_insertion.sessions import DEFAULT_SHARES, episode_specs

SPECS = episode_specs(11, 400)
SIDE = np.array([spec.mode == "left" for spec in SPECS])


def test_the_side_is_a_fair_coin():
    # Golden: binomial, 400 fair coins, six standard deviations of 10.
    assert abs(SIDE.sum() - 200) < 60


def test_the_side_depends_on_no_start_variable():
    starts = np.array([list(asdict(spec.start).values()) for spec in SPECS])
    standard = (starts - starts.mean(axis=0)) / starts.std(axis=0)
    design = np.column_stack([np.ones(len(SPECS)), standard, standard**2])
    coefficients, *_ = np.linalg.lstsq(design, SIDE.astype(float), rcond=None)
    explained = np.var(design @ coefficients) / np.var(SIDE)
    # 16 free regressors on 400 rows explain 16/399 = 4 % by chance; 11 % is beyond 1 in 10^4.
    assert explained < 0.11


@pytest.mark.parametrize("field", ["operator", "kind", "object_name", "calibration_epoch"])
def test_the_side_depends_on_no_stratum(field):
    names = [getattr(spec, field) for spec in SPECS]
    table = [
        [
            sum((n == name) & (s == side) for n, s in zip(names, SIDE, strict=True))
            for side in (0, 1)
        ]
        for name in sorted(set(names))
    ]
    assert chi2_contingency(np.array(table) + 0.5).pvalue > 1e-4


def test_a_plan_is_a_function_of_its_seed():
    assert episode_specs(11, 5)[3].start == episode_specs(11, 5)[3].start
    assert episode_specs(11, 5) != episode_specs(12, 5)
    np.random.seed(0)
    first = episode_specs(11, 5)
    np.random.seed(1)
    assert episode_specs(11, 5) == first


def test_epochs_and_times_run_forward():
    assert [s.calibration_epoch for s in SPECS] == sorted(s.calibration_epoch for s in SPECS)
    assert np.all(np.diff([s.start_time_ns for s in SPECS]) > 0)


def test_kinds_come_in_their_shares():
    counts = {kind: sum(s.kind == kind for s in SPECS) for kind in DEFAULT_SHARES}
    for kind, share in DEFAULT_SHARES.items():
        assert abs(counts[kind] - 400 * share) < 5 * np.sqrt(400 * share * (1 - share))
    assert {s.kind for s in episode_specs(1, 20, shares={"nominal": 1.0})} == {"nominal"}


@pytest.mark.parametrize(
    "shares", [{"nominal": 0.5}, {"no_such_kind": 1.0}, {"nominal": 1.5, "pushed": -0.5}]
)
def test_wrong_shares_are_refused(shares):
    with pytest.raises(ConfigError, match="Correct the shares"):
        episode_specs(1, 2, shares=shares)
