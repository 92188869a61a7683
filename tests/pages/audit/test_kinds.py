"""Both kinds of evidence on the page, what was guessed, and what to record next time."""

from dataclasses import replace

import pandas as pd
import pytest
from audited_cases import document
from planar import LIMITS

from genpolicy.audit.question_names import ALWAYS, OUTCOME_MISSING
from genpolicy.pages.audit.evidence import read_evidence
from genpolicy.pages.audit.kinds import RECORD, kinds, record_next
from genpolicy.pages.audit.page import audit_page, is_guess

SAID = {"rests_on": [], "limits": LIMITS.as_json()}


@pytest.fixture(scope="module")
def valid(audits):
    return read_evidence(audits["valid"])


def lacking(evidence, *checks, reach=None):
    """The same evidence, with these questions not asked and all others asked."""
    asked = pd.DataFrame({"check": [*ALWAYS, "clock.camera", "column.task"]})
    asked["asked"], asked["reason"] = ~asked["check"].isin(checks), ""
    tables = dict(evidence.tables) | {"asked": asked}
    return replace(evidence, tables=tables | ({} if reach is None else {"reach": reach}))


def reached(local, learned):
    rows = [
        {"kind": kind, "fifth": fifth + 1, "queries": 100, "spoke": spoke}
        for kind, each in (("local", local), ("learned", learned))
        for fifth, spoke in enumerate(each)
    ]
    return pd.DataFrame(rows)


def test_both_kinds_are_those_of_the_evidence(valid):
    local, learned = kinds(valid)
    sides = valid["sides"].set_index("kind")
    for kind, name in ((local, "local"), (learned, "learned")):
        row = sides.loc[name]
        assert kind.followed == row["followed"]
        assert kind.spoke == (row["analysed"], row["queries"])
        assert kind.episodes == (row["two_mode_episodes"], row["analysed_episodes"])
        assert [sum(part) for part in zip(*kind.fifths, strict=True)] == list(kind.spoke)
    assert local.followed and local.kept is not None and local.kept[0] > local.kept[1]
    assert learned.again == (
        sides.loc["learned"]["confirmed"],
        sides.loc["learned"]["contradicted"],
    )
    assert local.again is None


def test_what_lacks_is_asked_for_and_nothing_else(valid):
    whole = reached([100] * 5, [0] * 5)
    assert record_next(SAID, lacking(valid, reach=whole)) == []
    for name in RECORD:
        assert record_next(SAID, lacking(valid, name, reach=whole)) == [RECORD[name]]
    assert record_next(SAID, lacking(valid, "clock.camera", "column.task", reach=whole)) == [
        "when each sample of camera was received"
    ]
    without = SAID | {"rests_on": [OUTCOME_MISSING]}
    assert record_next(without, lacking(valid, "operator", reach=whole)) == [
        "whether each episode succeeded", RECORD["operator"],
    ]  # fmt: skip


def test_more_episodes_are_asked_for_where_neither_kind_can_speak(valid):
    half = 100 * LIMITS["denial_share"]
    thin = reached([0, half - 1, 100, half, 0], [half, 0, 0, 0, 0])
    (line,) = record_next(SAID, lacking(valid, reach=thin))
    assert "in the second and last fifth of the way" in line
    assert record_next(SAID, lacking(valid, reach=reached([half] * 5, [0] * 5))) == []


def test_the_page_shows_guesses_apart_and_both_kinds(audits, valid):
    lines = ["Units were guessed: <b>m</b>.", "Not asked: order (not recorded)."]
    assert [is_guess(line) for line in lines] == [True, False]
    page = audit_page(document(audits["valid"]) | {"rests_on": lines}, valid, name="x")
    guessed, _, rest = page.partition("<dt>Guessed</dt>")[2].partition("<dt>Rests on</dt>")
    assert "&lt;b&gt;m&lt;/b&gt;" in guessed and "Not asked: order" not in guessed
    assert "Not asked: order" in rest.partition("</dl>")[0]
    table = page.partition('<h2 id="evidence">')[2].partition("</table>")[0]
    assert "Near neighbours, of position, followed below" in table
    assert "Alike in what predicts, of the route alone</th>" in table
    row = valid["sides"].set_index("kind").loc["local"]
    assert f'value="{row["analysed"]}"' in table and f'value="{row["kept"]}"' in table
