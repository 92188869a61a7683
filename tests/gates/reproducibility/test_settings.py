"""Settings of Gate B: a mode's least share, and one number of evaluations per candidate."""

import evidence
import pytest
from asked import settings_of

from gates.evidence import Evidence, MissingEvidenceError
from gates.proof import judge
from gates.reproducibility.files import evaluations_said
from gates.reproducibility.settings import chosen_nfe
from genpolicy.errors import ConfigError

NFE = "reload/nfe.parquet"


def test_the_chosen_nfe_is_the_one_recorded(ladder):
    assert chosen_nfe(Evidence(ladder), "flow") == (8, 8)
    evidence.edit_table(ladder, NFE, lambda f: f.assign(recorded=4))
    assert chosen_nfe(Evidence(ladder), "flow") == (4, 4)


def test_a_sampler_that_chooses_its_steps_may_take_what_its_definition_allows(ladder):
    evidence.edit_table(ladder, NFE, lambda f: f.assign(recorded=22, least=4, most=61))
    assert chosen_nfe(Evidence(ladder), "flow") == (4, 61)


def test_a_candidate_that_records_several_nfe_has_chosen_none(ladder):
    def second(frame):
        return evidence.pd.concat([frame, frame.assign(seed=1, recorded=16)], ignore_index=True)

    evidence.edit_table(ladder, NFE, second)
    with pytest.raises(MissingEvidenceError, match="flow records several NFE: 8 to 16"):
        chosen_nfe(Evidence(ladder), "flow")


def test_trainings_whose_definitions_allow_other_counts_have_chosen_none(ladder):
    def second(frame):
        return evidence.pd.concat([frame, frame.assign(seed=1, most=61)], ignore_index=True)

    evidence.edit_table(ladder, NFE, second)
    for asked in (chosen_nfe, evaluations_said):
        with pytest.raises(MissingEvidenceError, match="allows flow several counts"):
            asked(Evidence(ladder), "flow")


def test_a_card_says_what_the_definition_allows_whatever_was_recorded(ladder):
    evidence.edit_table(ladder, NFE, lambda f: f.assign(recorded=4))
    assert evaluations_said(Evidence(ladder), "flow") == "8"
    evidence.edit_table(ladder, NFE, lambda f: f.assign(least=4, most=61))
    assert evaluations_said(Evidence(ladder), "flow") == "4 to 61"


@pytest.mark.parametrize("share", [0.001, 0.5])
def test_a_mode_may_need_a_few_samples_or_as_many_as_half(ladder, share):
    evidence.write_params(ladder, lambda p: p["gate_b"].update(mode_minimum_share=share))
    assert settings_of(ladder, "B").mode_minimum_share == share


def test_candidates_are_compared_with_somebody(ladder):
    evidence.write_params(ladder, lambda p: p["stress"].update(baselines=["bc"]))
    assert settings_of(ladder, "B").baselines == ("bc",)
    evidence.write_params(ladder, lambda p: p["stress"].update(baselines=[]))
    with pytest.raises(ConfigError, match="baselines"):
        settings_of(ladder, "B")


@pytest.mark.parametrize("share", [0.0, 0.6])
def test_no_mode_may_count_without_samples_or_need_more_than_half(ladder, share):
    evidence.write_params(ladder, lambda p: p["gate_b"].update(mode_minimum_share=share))
    with pytest.raises(ConfigError, match="mode_minimum_share"):
        judge(ladder, "B")
