"""A replay for Rerun: every place of a replay, on the journal's clock; and without the library."""

import sys

import pytest
from replayed import SESSION

from genpolicy.errors import BadInputError, ConfigError
from genpolicy.replay.replay import write_replay
from genpolicy.replay.rerun_form import write_rerun


def test_without_the_library_it_says_what_to_install(journal, tmp_path, monkeypatch):
    monkeypatch.setitem(sys.modules, "rerun", None)
    with pytest.raises(ConfigError, match=r"without the library rerun-sdk.*genpolicy\[rerun\]"):
        write_rerun(journal, tmp_path / "r.rrd", session=SESSION, task=None)
    assert not (tmp_path / "r.rrd").exists()


def test_it_has_what_a_replay_has_and_force_and_age(journal, tmp_path):
    pytest.importorskip("rerun")
    counts = write_rerun(journal, tmp_path / "r.rrd", session=SESSION, task=None)
    drawn = write_replay(journal, tmp_path / "r.mcap", session=SESSION, task=None).topics
    assert {place: n for place, n in counts.items() if place.startswith("/replay/")} == drawn
    assert counts["/journal/accept/age"] == drawn["/replay/commanded"]


def test_the_recording_can_be_read_and_its_times_are_those_of_the_journal(journal, tmp_path):
    chunk = pytest.importorskip("rerun.chunk")
    write_rerun(journal, tmp_path / "r.rrd", session=SESSION, task=None)
    store = chunk.RrdReader(tmp_path / "r.rrd").store()
    said = str(store.schema())
    for place in ("/replay/robot", "/replay/commanded", "/replay/raw", "/replay/projected",
                  "/replay/joints/commanded", "/journal/accept/age"):  # fmt: skip
        assert place in said
    assert "session" in said and "log_time" not in said


def test_an_unknown_session_is_refused_and_nothing_is_written(journal, tmp_path):
    pytest.importorskip("rerun")
    with pytest.raises(BadInputError, match="one of"):
        write_rerun(journal, tmp_path / "r.rrd", session="none", task=None)
    assert not (tmp_path / "r.rrd").exists()
