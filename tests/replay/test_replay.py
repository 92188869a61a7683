"""A replay as a file: whole or not at all, the same bytes, and the journal as it was."""

import hashlib
import shutil
import sys
from pathlib import Path

import pytest
from replayed import SESSION, added, copied

from genpolicy.errors import BadInputError, ConfigError, IntegrityError
from genpolicy.execution.journal import EVENT_FIELDS, JOURNAL_VERSION, Journal, write_journal
from genpolicy.integrity.hashing import sha256_file
from genpolicy.replay.replay import task_of, write_replay

sys.path.insert(0, str(Path(__file__).parents[1]))
from viewer_rules import unread


def write(journal, out, **options):
    return write_replay(journal, out, **{"session": SESSION, "task": None, **options})


def test_a_replay_has_the_journal_and_what_was_drawn(journal, tmp_path):
    before = sha256_file(journal)
    done = write(journal, tmp_path / "r.mcap")
    data = (tmp_path / "r.mcap").read_bytes()
    assert copied(data, SESSION) == copied(journal.read_bytes(), SESSION)
    assert done.events == len(copied(data, SESSION)) and done.session == SESSION
    counted = {}
    for topic, *_ in added(data):
        counted[topic] = counted.get(topic, 0) + 1
    assert done.topics == counted and len(counted) == 10
    assert sha256_file(journal) == before


def test_a_viewer_reads_every_channel_also_of_an_older_journal(journal, tmp_path, monkeypatch):
    write(journal, tmp_path / "r.mcap")
    assert unread((tmp_path / "r.mcap").read_bytes()) == ({}, 10 + len(EVENT_FIELDS))
    old = Journal("s")
    old.add("session", 0, {"version": JOURNAL_VERSION, "labels": {}})
    monkeypatch.setattr(
        "genpolicy.execution.journal.event_schema",
        lambda kind, fields: {"type": "object", "required": ["session", "n", "t", *fields]},
    )
    write_journal(tmp_path / "old.mcap", [old])
    assert unread((tmp_path / "old.mcap").read_bytes())[1] == 0
    write(tmp_path / "old.mcap", tmp_path / "r.mcap", session=None, task="tabletop_insertion")
    assert unread((tmp_path / "r.mcap").read_bytes())[0] == {}


def test_the_same_input_gives_the_same_bytes(journal, tmp_path):
    for name in ("1", "2"):
        write(journal, tmp_path / name)
    assert (tmp_path / "1").read_bytes() == (tmp_path / "2").read_bytes()
    write(journal, tmp_path / "3", session="flow/held_out/1")
    assert (tmp_path / "1").read_bytes() != (tmp_path / "3").read_bytes()


def test_every_session_of_a_shadow_test_can_be_replayed(journal, tmp_path):
    """Property: whatever happens in it, incidents and corruptions included."""
    from genpolicy.execution.journal import read_journal

    digests = set()
    names = list(read_journal(journal))
    assert len(names) > 60
    for name in names:
        if name.endswith("/0"):
            write(journal, tmp_path / "r.mcap", session=name)
            digests.add(hashlib.sha256((tmp_path / "r.mcap").read_bytes()).hexdigest())
    assert len(digests) == sum(name.endswith("/0") for name in names)


def test_the_task_is_that_of_the_ladder(journal, ladder, task, tmp_path):
    assert task_of(journal) == task.name
    deeper = ladder / "stress" / "journals" / "flow__push.mcap"
    deeper.parent.mkdir(parents=True, exist_ok=True)
    shutil.copy(journal, deeper)
    assert task_of(deeper) == task.name
    alone = tmp_path / "alone" / "j.mcap"
    alone.parent.mkdir()
    shutil.copy(journal, alone)
    with pytest.raises(ConfigError, match=r"--task is not given.*Name the task"):
        write(alone, tmp_path / "r.mcap")
    assert write(alone, tmp_path / "r.mcap", task=task.name).events


def test_nothing_is_left_behind_where_it_fails(journal, tmp_path):
    """Injected faults: cut off, of another task, with an event that nobody can read."""
    (tmp_path / "cut.mcap").write_bytes(journal.read_bytes()[:-30])
    bad = Journal("s")
    bad.add("session", 0, {"version": JOURNAL_VERSION, "labels": {}})
    bad.add("accept", 5, {"arrival": 0, "chunk_id": "c", "row": 0, "age_ns": 1, "action": "zz"})
    write_journal(tmp_path / "bad.mcap", [bad])
    strange = Journal("s")
    strange.add("session", 0, {"version": JOURNAL_VERSION, "labels": {}})
    strange.add("scene", 5, {"bodies": {"anvil": "00" * 24 + "000000000000f03f" + "00" * 24}})
    write_journal(tmp_path / "strange.mcap", [strange])
    none = Journal("s")
    none.add("session", 0, {"version": JOURNAL_VERSION})
    write_journal(tmp_path / "none.mcap", [none])
    before = sorted(tmp_path.iterdir())
    for name, session, said in (
        ("cut.mcap", SESSION, "whole MCAP journal"),
        ("bad.mcap", None, "an event that cannot be read"),
        ("strange.mcap", None, "naming .'anvil'."),
        ("none.mcap", None, "an event that cannot be read .KeyError: 'labels'"),
    ):
        with pytest.raises(BadInputError, match=said):
            write(tmp_path / name, tmp_path / "r.mcap", session=session, task="tabletop_insertion")
    with pytest.raises(ConfigError, match=r"one of .*tabletop_insertion"):
        write(journal, tmp_path / "r.mcap", task="no_such_task")
    with pytest.raises(IntegrityError):
        write(tmp_path / "gone.mcap", tmp_path / "r.mcap")
    assert sorted(tmp_path.iterdir()) == before


@pytest.mark.filterwarnings("ignore:invalid value encountered in det")
def test_a_number_that_is_none_is_not_written(tmp_path):
    bad = Journal("s")
    bad.add("session", 0, {"version": JOURNAL_VERSION, "labels": {}})
    action = "000000000000f87f" * 10
    bad.add("accept", 5, {"arrival": 0, "chunk_id": "c", "row": 0, "age_ns": 1, "action": action})
    write_journal(tmp_path / "bad.mcap", [bad])
    with pytest.raises(BadInputError, match="an event that cannot be read"):
        write(tmp_path / "bad.mcap", tmp_path / "r.mcap", session=None, task="tabletop_insertion")
    assert not (tmp_path / "r.mcap").exists()


def test_an_old_replay_stays_where_the_new_one_fails(journal, tmp_path):
    write(journal, tmp_path / "r.mcap")
    before = sha256_file(tmp_path / "r.mcap")
    with pytest.raises(BadInputError):
        write(journal, tmp_path / "r.mcap", session="none")
    assert sha256_file(tmp_path / "r.mcap") == before
