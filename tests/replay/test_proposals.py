"""Rejected proposals: their actions are those that were judged, or are not shown at all."""

import shutil

import numpy as np
import pyarrow.parquet as pq
import pytest

from genpolicy.errors import IntegrityError
from genpolicy.evidence.rows.shadow import CandidateRow
from genpolicy.execution.journal import read_journal
from genpolicy.integrity.rows import read_rows
from genpolicy.integrity.tables import write_table
from genpolicy.replay.proposals import TABLE, Proposals, _chunk

HELD = {"method": "flow", "fixture": "held_out", "observation": "0"}


@pytest.fixture(scope="session")
def judged(journal):
    """Payloads of the candidates of one held-out observation."""
    events = read_journal(journal)["flow/held_out/0"]
    return [event.payload for event in events if event.kind == "candidate"]


@pytest.fixture(scope="session")
def rows(ladder):
    return {
        row.candidate: row
        for row in read_rows(ladder / "shadow" / TABLE, CandidateRow)
        if (row.fixture, row.observation) == ("held_out", 0)
    }


def test_each_candidate_has_its_own_actions(ladder, judged, rows):
    proposals = Proposals(ladder / "shadow", HELD)
    found = [proposals.rejected(payload) for payload in judged]
    assert [item is None for item in found] == [not row.first_reason for row in rows.values()]
    assert sum(item is not None for item in found) >= 3
    for item in filter(None, found):
        row = rows[item.index]
        np.testing.assert_array_equal(item.raw.ravel(), np.array(row.raw))
        np.testing.assert_array_equal(item.projected.ravel(), np.array(row.projected))
        assert (item.reason, item.row) == (row.first_reason, row.first_row)
        assert (item.margin, item.unit) == (row.layer_margin, row.margin_unit)
        assert getattr(row, item.layer) is not True


def test_the_first_layer_judges_what_was_sampled_and_the_others_what_was_projected(ladder, judged):
    proposals = Proposals(ladder / "shadow", HELD)
    layers = set()
    for item in filter(None, map(proposals.rejected, judged)):
        layers.add(item.layer)
        assert item.judged is (item.raw if item.layer == "representation" else item.projected)
    assert layers == {"representation", "geometric"}


def test_what_touches_comes_from_the_gallery(ladder, judged):
    found = {
        item.reason: item
        for item in map(Proposals(ladder / "shadow", HELD).rejected, judged)
        if item is not None and item.layer == "geometric"
    }
    touching = [item.touching for item in found.values() if item.touching]
    other = Proposals(ladder / "shadow", {**HELD, "observation": "1"})._touching
    assert all(len(pair) == 2 for pair in touching)
    assert len(touching) + len([pair for pair in other.values() if pair]) >= 1
    for item in found.values():
        if item.touching:
            assert item.said.endswith(f"{item.touching[0]} and {item.touching[1]} touch")


def test_a_corrupted_fixture_is_not_what_the_gallery_shows(ladder):
    galleries = [
        Proposals(ladder / "shadow", {**HELD, "observation": number, "fixture": fixture})._touching
        for number in "01"
        for fixture in ("held_out", "phase_change_in_flight")
    ]
    assert (galleries[0] or galleries[2]) and not (galleries[1] or galleries[3])


def test_what_is_no_chunk_has_no_path():
    assert _chunk([0.0] * 15) is None and _chunk([]) is None
    assert _chunk([0.0] * 20).shape == (2, 10)


def test_a_reason_is_said_in_a_line(ladder, judged):
    first = Proposals(ladder / "shadow", HELD).rejected(judged[0])
    assert first.said.startswith("representation: gripper range, action 7, margin -0.1")
    assert first.said.endswith(" m") and "\n" not in first.said


def test_a_session_that_plays_what_was_judged_shows_the_same(ladder, judged):
    replayed = Proposals(ladder / "shadow", {**HELD, "fixture": "phase_change_in_flight"})
    assert replayed.rejected(judged[0]).raw is not None


def test_without_a_table_the_reason_is_all(tmp_path, judged):
    found = Proposals(tmp_path, HELD).rejected(judged[0])
    assert found.raw is None and found.projected is None and found.judged is None
    assert found.said.startswith("representation: gripper range")


def test_a_rollout_keeps_no_actions_of_what_was_rejected(ladder):
    labels = {"method": "flow", "perturbation": "push", "start": "0"}
    layers = {"representation": True, "kinematic": True, "geometric": False, "dynamic": None}
    payload = {"chunk_id": "a", "method": "flow", "index": 1, "layers": layers,
               "first_reason": "scene_collision", "measures": {}}  # fmt: skip
    found = Proposals(ladder / "shadow", labels).rejected(payload)
    assert (found.layer, found.raw, found.said) == (
        "geometric", None, "geometric: scene collision",
    )  # fmt: skip


@pytest.mark.parametrize("name", ["raw", "projected"])
def test_actions_of_another_run_are_refused(ladder, judged, tmp_path, name):
    """Injected fault: the table of another run beside the journal."""
    table = pq.read_table(ladder / "shadow" / TABLE)
    other = [[value + 1e-9 for value in row] for row in table[name].to_pylist()]
    place = table.schema.get_field_index(name)
    write_table(tmp_path / TABLE, table.set_column(place, table.schema.field(place), [other]))
    with pytest.raises(IntegrityError, match=f"{name} of candidate 0 is another one than the"):
        Proposals(tmp_path, HELD).rejected(judged[0])


def test_a_table_of_another_version_is_refused(ladder, tmp_path):
    write_table(tmp_path / TABLE, pq.read_table(ladder / "shadow" / TABLE).drop_columns(["raw"]))
    with pytest.raises(IntegrityError, match="missing column raw"):
        Proposals(tmp_path, HELD)


def test_a_gallery_of_another_form_is_refused(ladder, tmp_path):
    shutil.copy(ladder / "shadow" / TABLE, tmp_path)
    (tmp_path / "gallery.json").write_text("{}")
    with pytest.raises(IntegrityError, match="missing key"):
        Proposals(tmp_path, HELD)
