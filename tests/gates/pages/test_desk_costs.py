"""What it costs, by the rollouts themselves: counted here by hand, one row after the other."""

import evidence
import pandas as pd
import pytest

from gates.evidence import Evidence
from gates.pages.desk_costs import HEADS, costs_of, share
from gates.proof import judge

ROLLOUTS = "stress/rollouts.parquet"


def _uneven(frame):
    n = 7 * frame["start"] + 5 * frame.groupby(["method", "start"]).cumcount()
    success = frame["success"] & (n % 5 != 0)
    began = n % 3 == 0
    return frame.assign(
        success=success,
        outcome=success.map({True: "success", False: "timeout"}).mask(
            ~success & (n % 4 == 0), "force_stop"
        ),
        interventions=(n % 11 == 0) * 2,
        hold_ticks=n % 13,
        fallback_ticks=n % 7,
        deadline_misses=n % 4,
        force_peak_n=(n % 17) * 1.5,
        recovery_attempted=began,
        recovered=began & success & (n % 2 == 0),
    )  # fmt: skip


@pytest.fixture
def costs(copied):
    """Costs of uneven rollouts, and these as rows."""
    evidence.edit_table(copied, ROLLOUTS, _uneven)
    report = judge(copied, "D")
    rows = pd.read_parquet(copied / "artifacts" / ROLLOUTS).to_dict("records")
    planned = report.settings["perturbations"]
    return costs_of({"D": report}, Evidence(copied)), [
        r for r in rows if r["perturbation"] in planned
    ]


def _of(rows, hit, whole=lambda row: 1):
    hits, of = sum(hit(row) for row in rows), sum(whole(row) for row in rows)
    return (f"{100 * hits / of:.3g} %", f"{hits:,} of {of:,}") if hits else ("none", f"of {of:,}")


def test_each_cost_is_counted_over_all_planned_rollouts_of_its_method(costs):
    found, rows = costs
    assert (found.starts, found.conditions) == (evidence.STARTS, len(evidence.CONDITIONS))
    for method in found.methods:
        own = [row for row in rows if row["method"] == method.name]
        called = [row for row in own if row["perturbation"] != "recovery_drill"]
        force = sorted(row["force_peak_n"] for row in own)
        touched = sum(value > 0 for value in force)
        high = force[-(-95 * (len(force) - 1) // 100)]
        began = [row for row in own if row["recovery_attempted"]]
        expected = [
            _of(own, lambda r: int(r["success"])),
            _of(own, lambda r: int(r["interventions"] > 0)),
            _of(own, lambda r: int(r["outcome"] in {"collision", "force_stop"})),
            _of(own, lambda r: r["hold_ticks"], lambda r: r["ticks"]),
            _of(called, lambda r: r["fallback_ticks"], lambda r: r["ticks"]),
            _of(own, lambda r: r["deadline_misses"], lambda r: r["invocations"]),
            (f"{high:.3g} N", f"touched in {touched:,} of {len(own):,}"),
            _of(began, lambda r: int(r["recovered"])),
        ]
        assert [(cell.value, cell.of) for cell in method.cells] == expected, method.name
        assert len(expected) == len(HEADS)


def test_simple_methods_stand_first_and_the_promoted_is_marked(whole, judged):
    found = costs_of({"D": judged("D")}, Evidence(whole)).methods
    kinds = [method.kind for method in found]
    assert kinds == sorted(kinds, reverse=True) and set(kinds) == {"simple", "candidate"}
    assert {m.name for m in found if m.kind == "candidate"} == set(evidence.CANDIDATES)
    assert [m.name for m in found if m.promoted] == [judged("D").promoted]


def test_what_never_touched_has_no_force_and_what_never_began_no_share(copied):
    evidence.edit_table(
        copied, ROLLOUTS,
        lambda f: f.assign(force_peak_n=0.0, recovery_attempted=False, recovered=False),
    )  # fmt: skip
    found = costs_of({"D": judge(copied, "D")}, Evidence(copied)).methods[0].cells
    rollouts = evidence.STARTS * len(evidence.CONDITIONS)
    assert (found[6].value, found[6].of) == ("no contact", f"in {rollouts} rollouts")
    assert (found[7].value, found[7].of) == ("never tried", "")


@pytest.mark.parametrize(
    ("hits", "of", "value", "text"),
    [(288, 300, "96 %", "288 of 300"), (0, 1080, "none", "of 1,080"),
     (1, 3000, "0.0333 %", "1 of 3,000"),
     (300, 300, "100 %", "300 of 300")],
)  # fmt: skip
def test_a_share_says_what_it_is_a_share_of(hits, of, value, text):
    assert (share(hits, of).value, share(hits, of).of) == (value, text)


def test_rollouts_that_were_not_judged_are_not_shown(copied, judged):
    assert "gate D was not judged" in costs_of({}, Evidence(copied)).missing
    evidence.edit_table(copied, ROLLOUTS, _uneven)
    other = costs_of({"D": judged("D")}, Evidence(copied))
    assert "not the file that the report names" in other.missing and not other.methods
    (copied / "artifacts" / ROLLOUTS).unlink()
    assert (
        "is missing: it is not built here" in costs_of({"D": judged("D")}, Evidence(copied)).missing
    )
