"""Both rules of matching, with a verdict each, and on whose side something remains."""

import evidence
import pytest
from asked import asked

from gates.evidence import Evidence, MissingEvidenceError
from gates.proof import judge
from gates.reproducibility.gate import unmatched_keys
from gates.reproducibility.matching import matched_by, pairs

BY_CONVERGENCE = "Equal convergence (the loss of both falls by 0.1 at most over the last quarter):"


def train(root, stage, method, rows):
    path = f"{stage}/{method}/seed_0/validation.parquet"
    evidence.table(root, path, evidence.ValidationRow, rows)
    evidence.record(root)


def said_of(root, candidate="flow"):
    report = judge(root, "B")
    (found,) = [text for text in report.caveats if text.startswith(f"{candidate}, matched ")]
    return found


def found_of(root, **changed):
    asked = {"candidates": ("flow",), "baselines": ("act", "bc"), "limit": 0.1, "confidence": 0.95}
    return pairs(Evidence(root), **{**asked, **changed})


def test_both_rules_hold_where_all_took_as_many_updates_and_all_are_done(ladder):
    assert not [text for text in judge(ladder, "B").caveats if "matched" in text]
    for pair in found_of(ladder):
        assert (pair.by_updates, pair.by_convergence, pair.remains) == ("PASS", "PASS", "")
        # By hand: 1.5 and 1.0 over 0.96 at the end; 1.0 is within a tenth of it, 1.5 is not.
        assert (pair.candidate.near, pair.baseline.near) == (3000, 3000)


@pytest.mark.parametrize(
    ("stage", "method", "remains"),
    [("train_generators", "flow", "flow, to its own cost"),
     ("train_baselines", "act", "act, in favour of the candidate")],
)  # fmt: skip
def test_a_training_that_is_not_done_breaks_the_second_rule_on_either_side(
    ladder, stage, method, remains
):
    train(ladder, stage, method, evidence.validation(0.3))
    said = said_of(ladder)
    assert "Equal updates: PASS." in said
    assert f"{BY_CONVERGENCE} FAIL; may still learn: {remains}. The page" in said
    pair = found_of(ladder)[0]
    assert pair.by_convergence == "FAIL" and pair.remains == remains
    late = pair.candidate if method == "flow" else pair.baseline
    assert late.near == evidence.UPDATES  # only its end is near its end


def test_what_is_neither_shown_nor_refuted_is_neither(ladder):
    """Episodes that fall by nothing and by a fifth: the limit lies inside the interval."""
    rows = [
        row if row["updates"] != evidence.UPDATES or int(row["episode_uuid"][1:]) % 2
        else {**row, "loss": row["loss"] * 0.84}
        for row in evidence.validation(0.02)
    ]  # fmt: skip
    train(ladder, "train_generators", "flow", rows)
    pair = found_of(ladder)[0]
    assert pair.candidate.fall.interval[0] < 0.1 < pair.candidate.fall.interval[1]
    assert pair.by_convergence == "INCONCLUSIVE" and pair.remains == "flow, to its own cost"


def test_another_number_of_updates_breaks_the_first_rule(ladder):
    def longer(document):
        document["methods"]["flow"]["config"]["training"]["updates"] = 5333

    evidence.edit_document(ladder, "train_generators/matched.json", longer)
    rows = [
        {**row, "updates": {2000: 2000, 3000: 4000, 4000: 5333}[row["updates"]]}
        for row in evidence.validation()
    ]
    train(ladder, "train_generators", "flow", rows)
    assert "Equal updates: FAIL." in said_of(ladder)
    assert f"{BY_CONVERGENCE} PASS" in said_of(ladder)


def test_what_was_not_measured_is_said(ladder):
    train(ladder, "train_baselines", "act",
          [row for row in evidence.validation() if row["updates"] != 3000])  # fmt: skip
    assert "equal updates and convergence: not measured" in said_of(ladder)


def test_without_a_baseline_that_says_so(ladder):
    asked = {"candidates": ("flow",), "limit": 0.1, "confidence": 0.95}
    (said,) = matched_by(Evidence(ladder), baselines=(), **asked)
    assert said == "flow, matched by two rules: no baseline to match with."


def test_a_baseline_whose_weights_are_gone_is_still_one_that_was_trained(ladder):
    (ladder / "artifacts/train_baselines/act/seed_0/model.safetensors").unlink()
    with pytest.raises(MissingEvidenceError, match="while act was trained"):
        found_of(ladder)


def test_without_a_limit_nobody_says_what_is_done(ladder):
    evidence.write_params(
        ladder, lambda params: params["gate_b"]["limits"]["model"].pop("baseline_fall_upper")
    )
    assert "no limit says what is done" in said_of(ladder)


def _configured(ladder, change):
    evidence.edit_document(
        ladder, "train_generators/matched.json", lambda d: change(d, d["methods"]["flow"]["config"])
    )
    return asked(ladder, unmatched_keys, "flow", gate="B")


@pytest.mark.parametrize(
    ("part", "key", "value"),
    [("training", "learning_rate", 9.0), ("normalisation", "action", {"minimum": [5.0]}),
     ("horizons", "execution_horizon", 4)],
)  # fmt: skip
def test_a_setting_that_differs_and_is_not_listed_counts_by_name(ladder, part, key, value):
    """The list is what training says of the configurations; they stand beside it."""
    found = _configured(ladder, lambda d, own: own[part].update({key: value}))
    assert found.value >= 1 and f"{part}.{key}" in found.caveat


def test_it_says_how_many_settings_were_compared_of_either_side(ladder):
    def counted(change):
        return int(_configured(ladder, change).counted.removeprefix("all ").split()[0])

    before = counted(lambda d, own: None)
    assert counted(lambda d, own: own["horizons"].update(one_more=1)) == before + 1
    # What only the reference has is compared as well, and what training counts is no setting.
    assert counted(lambda d, own: own["horizons"].clear()) == before
    assert counted(lambda d, own: own["parameters"].update(one_more=1)) == before


def test_what_is_so_by_definition_or_a_count_is_no_setting_that_differs(ladder):
    def change(document, own):
        own["parameters"]["head"] = 11
        own["horizons"]["prediction_horizon"] = 1
        document["single_action_keys"] = ["horizons.prediction_horizon"]

    assert _configured(ladder, change).value == 0


@pytest.mark.parametrize("listed", ["one_mode_keys", "single_action_keys"])
@pytest.mark.parametrize(
    ("part", "key", "value"),
    [("training", "learning_rate", 9.0), ("provenance", "episodes_sha256", "e" * 64)],
)
def test_a_list_of_what_is_so_by_definition_hides_nothing_else(ladder, listed, part, key, value):
    """No candidate learns one mode by definition, and what one action implies is known here."""

    def change(document, own):
        own[part][key] = value
        own["horizons"]["prediction_horizon"] = 1
        document[listed] = [f"{part}.{key}"]

    found = _configured(ladder, change)
    assert found.value == 1 and f"{part}.{key}" in found.caveat


def test_without_the_reference_nothing_is_matched(ladder):
    with pytest.raises(MissingEvidenceError, match="has no entry of chunked_bc"):
        _configured(ladder, lambda d, own: d["methods"].pop("chunked_bc") and None)
