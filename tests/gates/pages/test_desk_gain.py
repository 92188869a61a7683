"""What is asked, in numbers: successes counted by hand, and nothing where nobody is promoted."""

import re

import evidence
import numpy as np
import pandas as pd
import pytest

from gates.evidence import Evidence
from gates.pages.desk_gain import gain_of
from gates.writing import write_gate
from genpolicy.statistics.eprocess import gain_interval

ROLLOUTS = "stress/rollouts.parquet"


def rows_of(root, report):
    rows = pd.read_parquet(root / "artifacts" / ROLLOUTS)
    return rows[rows["perturbation"].isin(report.settings["perturbations"])]


def test_every_number_of_the_sentence_is_counted_again(ladder, judged):
    report = judged("D")
    rows, said = rows_of(ladder, report), gain_of({"D": report}, Evidence(ladder))
    counted = {name: (int(own["success"].sum()), len(own)) for name, own in rows.groupby("method")}
    best = max(report.settings["baselines"], key=lambda name: counted[name][0] / counted[name][1])
    for name in (report.promoted, best):
        won, of = counted[name]
        assert f"{100 * won / of:.3g} % ({won:,} of {of:,})" in said
    means = {
        name: rows[rows["method"] == name].groupby("start")["success"].mean()
        for name in (report.promoted, best)
    }
    differences = (means[report.promoted] - means[best]).to_numpy()
    alpha = report.settings["family_alpha"] / len(report.settings["candidates"])
    low, high = gain_interval(differences, alpha=alpha)
    points = [float(found) / 100 for found in re.findall(r"[+-][\d.]+", said.replace("−", "-"))]
    expected = [np.mean(differences), low, high, report.settings["margin"]]
    assert points == pytest.approx(expected, abs=0.0006)  # three digits are shown
    assert f"same {len(differences)} starts in {rows['perturbation'].nunique()} conditions" in said
    assert low >= report.settings["margin"] - 0.001  # it was promoted
    write_gate(ladder, "D")
    assert said in (ladder / "reports/index.html").read_text()


def test_nobody_promoted_or_other_rollouts_say_nothing(ladder, judged):
    report = judged("D")
    assert gain_of({}, Evidence(ladder)) == ""
    nobody = report.model_copy(update={"promoted": None})
    assert gain_of({"D": nobody}, Evidence(ladder)) == ""
    evidence.edit_table(ladder, ROLLOUTS, lambda frame: frame.assign(duration_s=1.0))
    assert gain_of({"D": report}, Evidence(ladder)) == ""
