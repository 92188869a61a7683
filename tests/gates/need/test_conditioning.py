"""Conditioning: only significant strata count, the phase takes modes away or nothing does."""

import evidence
import pytest
from asked import asked, settings_of
from editing import cells

from gates.evidence import MissingEvidenceError
from gates.need import conditioning
from genpolicy.statistics.intervals import clopper_pearson


def test_an_effect_counts_only_where_it_is_significant(ladder):
    level = settings_of(ladder, "A").strata_level
    table = "audit/strata.parquet"
    evidence.edit_table(ladder, table, lambda f: f.assign(effect=0.9, p_adjusted=level * 1.01))
    quiet = asked(ladder, conditioning.strata_effect, gate="A")
    assert quiet.value == 0.0 and "none of" in quiet.caveat
    evidence.edit_table(ladder, table, cells("p_adjusted", level, share=0.01))
    evidence.edit_table(ladder, table, cells("effect", -0.4, share=0.01))
    assert asked(ladder, conditioning.strata_effect, gate="A").value == 0.4


@pytest.mark.parametrize(("without", "seen", "lost"), [(20, 20, 0), (20, 5, 15), (20, 30, 0)])
def test_the_collapse_is_the_upper_bound_of_what_the_phase_takes_away(ladder, without, seen, lost):
    counts = {"modes_without_phase": without, "modes_with_phase": seen}
    evidence.edit_document(ladder, "audit/summary.json", lambda d: {**d, **counts})
    found = asked(ladder, conditioning.phase_collapse_share, gate="A")
    assert found.value == clopper_pearson(lost, without, settings_of(ladder, "A").confidence)[1]


def test_without_modes_nothing_collapses_and_without_the_number_nothing_is_known(ladder):
    none = {"modes_without_phase": 0, "modes_with_phase": 0}
    evidence.edit_document(ladder, "audit/summary.json", lambda d: {**d, **none})
    assert asked(ladder, conditioning.phase_collapse_share, gate="A").value == 0.0
    evidence.edit_document(ladder, "audit/summary.json", lambda d: {**d, "modes_with_phase": None})
    with pytest.raises(MissingEvidenceError):
        asked(ladder, conditioning.phase_collapse_share, gate="A")
