"""What passes of each mode, and what became of every action."""

import evidence
import pytest

from gates.evidence import Evidence
from gates.feasibility.settings import CANDIDATES
from gates.pages.figures import draw_all
from gates.pages.tables_survival import COUNTS, LISTINGS
from gates.proof import judge
from gates.words import share_between
from genpolicy.statistics.intervals import clopper_pearson

TABLE, BALANCE = (path.removeprefix("artifacts/") for path in (CANDIDATES, COUNTS))


def shown(root, judged):
    survival, became = draw_all(LISTINGS, Evidence(root), judged("C"))
    assert survival.skipped == became.skipped == ""
    return [
        [dict(zip(heads, line, strict=True)) for line in lines]
        for heads, *lines in (survival.listed, became.listed)
    ]


def test_a_mode_that_loses_half_shows_half_with_its_interval_over_episodes(copied, judged):
    def lost(frame):
        own = (frame["method"] == "flow") & (frame["fixture"] == "held_out")
        gone = own & (frame["mode"] == "left") & (frame["observation"] % 2 == 0)
        return frame.assign(
            dynamic=frame["dynamic"].mask(gone, False),
            outcome=frame["outcome"].mask(gone, "failed"),
            first_reason=frame["first_reason"].mask(gone, "joint_jerk"),
        )

    evidence.edit_table(copied, TABLE, lost)
    lines, _ = shown(copied, judged)
    own = {
        line["mode"]: line
        for line in lines
        if (line["method"], line["observations"]) == ("flow", "held out")
    }
    passed, total = (int(part) for part in own["left"]["admitted"].split(" of "))
    episodes = int(own["left"]["episodes"])
    assert 0 < passed < total and own["right"]["share, interval"].startswith("100 %")
    share = passed / total
    ends = clopper_pearson(int(round(share * episodes, 9) // 1), episodes, 0.95)
    assert own["left"]["share, interval"] == share_between(share, *ends)


def test_a_mode_of_too_few_episodes_says_how_many_are_needed(copied, judged):
    def rare(frame):
        at = (frame["fixture"] == "held_out") & (frame["mode"] == "left")
        seen = frame.loc[at, "observation"].unique()
        return frame.assign(mode=frame["mode"].mask(at & ~frame["observation"].isin(seen[:29]), ""))

    evidence.edit_table(copied, TABLE, rare)
    lines, _ = shown(copied, judged)
    told = {line["mode"]: line["episodes"] for line in lines if line["observations"] == "held out"}
    assert told["left"] == "29, fewer than the 30 needed"
    assert told["right"].isdigit() and int(told["right"]) >= 30


def test_every_action_went_somewhere(whole, judged):
    _, lines = shown(whole, judged)
    for method in evidence.CANDIDATES:
        own = {line["became of it"]: line for line in lines if line["method"] == method}
        for place in ("held out", "corrupted", "on the way"):
            total = float(own["all that was generated"][place])
            parts = [float(line[place]) for name, line in own.items() if not name.startswith("all")]
            assert total == sum(parts) > 0


def test_what_was_discarded_stands_by_its_reason_with_an_interval(copied):
    def renamed(frame):
        own = (frame["method"] == "flow") & (frame["fixture"] == "held_out")
        return frame.assign(reason=frame["reason"].mask(own & (frame["count"] > 0), "expired"))

    evidence.edit_table(copied, BALANCE, renamed)
    _, lines = shown(copied, lambda gate: judge(copied, gate))
    (line,) = (
        line for line in lines if (line["method"], line["became of it"]) == ("flow", "expired")
    )
    assert line["held out"] == "15" and line["share, interval"].startswith("15 % (")


@pytest.mark.parametrize(
    ("share", "interval", "text"),
    [
        (0.5, (0.25, 0.755), "50 % (25 to 75.5)"),
        (0.0, (0.0, 0.0321), "0 % (0 to 3.21)"),
        (1.0, (0.955, 1.0), "100 % (95.5 to 100)"),
    ],
)
def test_a_share_is_said_in_percent(share, interval, text):
    assert share_between(share, *interval) == text
