"""One figure and one table a gate, of judged evidence only; the numbers counted here by hand."""

import evidence
import pandas as pd
import pytest

from gates.evidence import Evidence
from gates.pages import desk_gates as module
from gates.pages.desk_card import Signing
from gates.pages.desk_gates import SHOWN, exhibits_of
from gates.pages.figures import draw_all
from gates.pages.rows import rows_of
from gates.report import GATES
from gates.writing import write_gate

NOTHING = Signing(missing="no card is drafted")


def shown(reports, root):
    """The exhibits as the desk asks for them."""
    rows = {gate: rows_of(root, report) for gate, report in reports.items()}
    return exhibits_of(reports, Evidence(root), NOTHING, rows)


@pytest.fixture(scope="module")
def exhibits(whole, judged):
    found = shown({gate: judged(gate) for gate in "ABCD"}, whole)
    return {item.gate: item for item in found}


def _plain(table):
    return [tuple(cell.replace("\u00a0", " ") for cell in row) for row in table]


def test_every_gate_with_evidence_has_one_figure_and_one_table_with_their_rows(exhibits):
    assert list(exhibits) == list(GATES) and set(SHOWN) == set("ABCD")
    for gate in SHOWN:
        item = exhibits[gate]
        assert item.figure.svg and len(item.table.listed) > 1 and not item.missing, gate
        sources = {*item.figure.sources, *item.table.sources}
        assert {file.path for file in item.rows} == sources - {
            "artifacts/audit/summary.json" if gate != "A" else ""
        }


@pytest.mark.parametrize("gate", SHOWN)
def test_an_exhibit_is_made_of_what_it_names_and_is_the_same_wherever_that_lies(
    whole, judged, copied, monkeypatch, gate
):
    """It is kept by its report alone, which names the bytes of all that it is made of."""
    evidence_of = Evidence(whole)
    with evidence_of.recorded() as read:
        draw_all(SHOWN[gate], evidence_of, judged(gate))
    named = {path for item in SHOWN[gate] for path in (item.source, *item.also)}
    assert {*read, *evidence_of.materials} == named
    kept = shown({gate: judged(gate)}, whole)
    monkeypatch.setattr(module, "draw_all", lambda *asked: pytest.fail("drawn again"))
    assert shown({gate: judged(gate)}, copied) == kept


def test_success_is_counted_in_each_condition(exhibits, whole):
    heads, *lines = _plain(exhibits["D"].table.listed)
    frame = pd.read_parquet(whole / "artifacts/stress/rollouts.parquet")
    assert heads[0] == "method"
    assert [head.replace(" ", "_") for head in heads[1:]] == list(evidence.CONDITIONS)
    for method, *cells in lines:
        own = frame[frame["method"] == method]
        for cell, name in zip(cells, evidence.CONDITIONS, strict=True):
            won = own.loc[own["perturbation"] == name, "success"]
            assert cell == f"{100 * won.mean():.3g} %, {won.sum()} of {len(won)}"


def test_modes_and_layers_are_counted(exhibits, whole):
    modes = pd.read_parquet(whole / "artifacts/audit/modes.parquet")
    lines = {line[0]: line for line in _plain(exhibits["A"].table.listed)[1:]}
    for row in modes.to_dict("records"):
        assert lines[row["mode"]][2].endswith(f"{row['successes']} of {row['episodes']}")
        assert lines[row["mode"]][3].endswith(f"{row['admissible']} of {row['checked']}")
    frame = pd.read_parquet(whole / "artifacts/shadow/candidates.parquet")
    for method, held, corrupted in _plain(exhibits["C"].table.listed)[1:]:
        own = frame[frame["method"] == method]
        passed = own[own["fixture"] == "held_out"]["outcome"] == "passed"
        assert held.endswith(f"{passed.sum()} of {len(passed)}")
        assert corrupted.startswith("none, of")


def test_latencies_are_those_of_candidates_in_milliseconds(exhibits, judged):
    heads, *lines = exhibits["B"].table.listed
    assert heads == ("candidate", "warm p50", "warm p95", "cold p50", "cold p95")
    assert [line[0] for line in lines] == list(judged("B").candidates)
    assert all(cell.endswith(" ms") for line in lines for cell in line[1:])


def test_other_evidence_than_was_judged_is_not_shown(copied, judged):
    evidence.edit_table(copied, "audit/modes.parquet", lambda f: f.assign(successes=1))
    found = shown({"A": judged("A")}, copied)
    assert found[0].figure is found[0].table is None
    assert "modes.parquet is not the file that the report names" in found[0].missing
    (copied / "reports/gate_b.json").write_text("{")
    (copied / "reports/gate_c.json").unlink(missing_ok=True)
    found = shown({"A": judged("A")}, copied)
    assert [item.missing for item in found[1:3]] == [module.UNREADABLE, module.NOT_JUDGED]


def test_the_same_evidence_is_drawn_once(whole, judged, exhibits, monkeypatch):
    monkeypatch.setattr(module, "draw_all", None)
    again = shown({gate: judged(gate) for gate in "ABCD"}, whole)
    assert {item.gate: item for item in again} == exhibits


def test_the_trial_card_shows_who_has_signed_and_who_has_not(whole, judged):
    signing = Signing(signed=("ada (reviewer)",), lacking=("model", "safety"))
    item = module._exhibit("E", judged("D"), Evidence(whole), signing, {})
    assert item.table.listed == (
        ("who", "signature"), ("ada (reviewer)", "has signed"),
        ("model", "has not signed"), ("safety", "has not signed"),
    )  # fmt: skip
    nobody = module._exhibit("E", judged("D"), Evidence(whole), NOTHING, {})
    assert nobody.missing == NOTHING.missing


def test_the_desk_links_to_rows_that_lie_there(copied):
    """Every link into a folder of rows, of a workspace in which all of it was printed."""
    for gate in "ABCD":
        write_gate(copied, gate)
    page = (copied / "reports/index.html").read_text()
    links = {part.split('"')[0] for part in page.split('href="')[1:]}
    rows = {link for link in links if link.endswith(".csv")}
    assert {link.split("/")[0] for link in rows} == {"gate_a", "gate_b", "gate_c", "gate_d"}
    assert "gate_d/stress.rollouts.chunked_bc.csv" in rows
    for gate in "abcd":
        text = (copied / f"reports/gate_{gate}.html").read_text()
        rows |= {link for part in text.split('href="')[1:] if (link := part.split('"')[0])
                 .endswith(".csv")}  # fmt: skip
    assert len(rows) > 60 and all((copied / "reports" / link).is_file() for link in rows)
    anchors = {link for link in links if "#" in link.lstrip("#")}
    for link in anchors:
        name, _, place = link.partition("#")
        assert f'id="{place}"' in (copied / "reports" / name).read_text(), link
