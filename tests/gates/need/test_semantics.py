"""Questions to the data themselves."""

import evidence
import pytest

from gates.proof import judge
from genpolicy.errors import ConfigError


def _found(report, name):
    return [c for c in report.criteria if c.id == name]


def test_golden_exact_bound_of_label_disagreement(repo):
    """0 of 40: upper end 1 - 0.025^(1/40) = 0.0881, Clopper and Pearson 1934."""
    found = _found(judge(repo, "A"), "label_disagreement")[0]
    assert found.measured == pytest.approx(1 - 0.025 ** (1 / 40), abs=1e-12)


def _unasked(frame):
    frame.loc[frame["check"] == "operator", ["asked", "reason"]] = [False, "not recorded"]
    return frame


def _waive(check, reason, owner="perception"):
    def change(params):
        params["gate_a"]["waived_checks"] = {owner: {check: reason}}

    return change


def test_what_was_not_asked_is_inconclusive_until_somebody_answers_for_it(ladder):
    evidence.edit_table(ladder, "audit/asked.parquet", _unasked)
    report = judge(ladder, "A")
    found = _found(report, "unasked_checks")[0]
    assert (report.verdict, found.verdict, found.measured) == ("INCONCLUSIVE",) * 2 + (None,)
    assert "operator (not recorded)" in found.caveat and "unasked_checks" in report.diagnosis

    evidence.write_params(ladder, _waive("operator", "one person demonstrated"))
    report = judge(ladder, "A")
    assert report.verdict == "PASS"
    said = [text for text in report.caveats if text.startswith("operator")]
    assert said and "perception owner" in said[0] and "one person" in said[0]


def test_a_waiver_waives_only_what_it_names(ladder):
    evidence.edit_table(ladder, "audit/asked.parquet", _unasked)
    evidence.write_params(ladder, _waive("labels", "x"))
    assert judge(ladder, "A").verdict == "INCONCLUSIVE"


@pytest.mark.parametrize(
    ("change", "match"),
    [(_waive("operater", "x"), "a waiver of no question"), (_waive("operator", " "), "waived"),
     (_waive("operator", "x", owner="nobody"), "waived")],
)  # fmt: skip
def test_a_waiver_without_name_or_reason_is_refused(ladder, change, match):
    evidence.write_params(ladder, change)
    with pytest.raises(ConfigError, match=match):
        judge(ladder, "A")
