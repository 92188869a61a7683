"""The journal is copied to the byte; damage, another version and another session are refused."""

import io
import json

import pytest
from mcap.reader import make_reader
from mcap.writer import CompressionType, Writer
from replayed import SESSION, added, copied, messages_of

from genpolicy.errors import BadInputError, IntegrityError
from genpolicy.execution.journal import EVENT_FIELDS, JOURNAL_VERSION, Journal, write_journal
from genpolicy.replay import journal_file
from genpolicy.replay.journal_file import Drawn, read_session, write_replay_bytes
from genpolicy.replay.messages import SCENE_SCHEMA_NAME, scene_update


def drawn(*times):
    return [Drawn("/replay/scene", SCENE_SCHEMA_NAME, t, scene_update(t, [])) for t in times]


def declared(name="s", version=JOURNAL_VERSION, times=(0.1, 0.2)):
    journal = Journal(name)
    journal.add("session", 0, {"version": version, "labels": {}})
    for time_s in times:
        journal.invocation(time_s, invocation_id="i", stage="begin")
    return journal


def test_a_session_is_copied_to_the_byte(journal):
    data = write_replay_bytes(read_session(journal, SESSION), drawn(0, 50_000_000, 1 << 40))
    assert copied(data, SESSION) == copied(journal.read_bytes(), SESSION) != []
    assert {m[1].topic for m in messages_of(data) if m[1].topic.startswith("/journal/")} <= {
        f"/journal/{kind}" for kind in EVENT_FIELDS
    }


def test_other_sessions_stay_where_they_are(journal):
    data = write_replay_bytes(read_session(journal, SESSION), [])
    sessions = {json.loads(message.data)["session"] for _, _, message in messages_of(data)}
    assert sessions == {SESSION}


def test_every_channel_of_the_journal_is_there_with_its_schema(journal):
    data = write_replay_bytes(read_session(journal, SESSION), drawn(0))
    found = []
    for file in (journal.read_bytes(), data):
        summary = make_reader(io.BytesIO(file)).get_summary()
        found.append(
            {
                (c.topic, c.message_encoding, summary.schemas[c.schema_id].name,
                 summary.schemas[c.schema_id].data)
                for c in summary.channels.values()
            }
        )  # fmt: skip
    assert found[0] < found[1] and len(found[1] - found[0]) == 1


def test_what_is_drawn_follows_the_events_of_its_time(tmp_path):
    path = tmp_path / "j.mcap"
    write_journal(path, [declared()])
    data = write_replay_bytes(
        read_session(path, None), drawn(0, 100_000_000, 150_000_000, 200_000_000)
    )
    order = [(c.topic[1:7], m.log_time // 1_000_000) for _, c, m in messages_of(data)]
    assert order == [
        ("journa", 0), ("replay", 0), ("journa", 100), ("replay", 100), ("replay", 150),
        ("journa", 200), ("replay", 200),
    ]  # fmt: skip


def test_nothing_that_is_drawn_is_lost(tmp_path):
    path = tmp_path / "j.mcap"
    write_journal(path, [declared()])
    data = write_replay_bytes(read_session(path, None), drawn(9_000_000_000, 0, 150_000_000))
    assert [m[2] for m in added(data)] == [0, 150_000_000, 9_000_000_000]


def test_one_session_needs_no_name_and_several_do(tmp_path, journal):
    path = tmp_path / "j.mcap"
    write_journal(path, [declared("only")])
    assert read_session(path, None).session == "only"
    with pytest.raises(BadInputError, match=r"not given, expected one of .*flow/held_out/0.*more"):
        read_session(journal, None)
    with pytest.raises(BadInputError, match="'flow/nothing/0', expected one of"):
        read_session(journal, "flow/nothing/0")


def test_a_journal_of_another_version_is_refused(tmp_path):
    path = tmp_path / "j.mcap"
    write_journal(path, [declared(version=5)])
    with pytest.raises(BadInputError, match=f"version 5, expected version {JOURNAL_VERSION}"):
        read_session(path, None)


def test_a_session_that_does_not_declare_itself_is_refused(tmp_path):
    path, journal = tmp_path / "j.mcap", Journal("s")
    journal.invocation(0.1, invocation_id="i", stage="begin")
    write_journal(path, [journal])
    with pytest.raises(BadInputError, match="does not declare itself first"):
        read_session(path, None)


@pytest.mark.parametrize("keep", [0, 8, 100, 0.5, -1, -20])
def test_a_journal_that_is_cut_off_is_refused(journal, tmp_path, keep):
    whole = journal.read_bytes()
    cut = int(keep * len(whole)) if isinstance(keep, float) else keep
    (tmp_path / "j.mcap").write_bytes(whole[:cut])
    with pytest.raises(BadInputError, match="whole MCAP journal"):
        read_session(tmp_path / "j.mcap", SESSION)


def test_a_journal_with_another_byte_is_refused(journal, tmp_path):
    whole = bytearray(journal.read_bytes())
    for index in make_reader(io.BytesIO(whole)).get_summary().chunk_indexes:
        place = index.chunk_start_offset + index.chunk_length // 2
        whole[place] ^= 0x40
        (tmp_path / "j.mcap").write_bytes(whole)
        with pytest.raises(BadInputError, match="whole MCAP journal"):
            read_session(tmp_path / "j.mcap", SESSION)
        whole[place] ^= 0x40


def plain(path, **options):
    """A journal of one event, not compressed, so that nothing but a checksum tells another byte."""
    with path.open("wb") as stream:
        writer = Writer(stream, compression=CompressionType.NONE, **options)
        writer.start()
        channel = writer.register_channel("/journal/session", "json", 0, {"made": "by hand"})
        event = {"session": "name", "n": 0, "t": 5, "version": JOURNAL_VERSION, "labels": {}}
        writer.add_message(channel, 5, json.dumps(event).encode(), 5)
        writer.finish()
    return path


def test_another_letter_is_found_by_the_checksum(tmp_path):
    path = plain(tmp_path / "j.mcap")
    assert read_session(path, None).session == "name"
    path.write_bytes(path.read_bytes().replace(b'"name"', b'"game"'))
    with pytest.raises(BadInputError, match="whole MCAP journal"):
        read_session(path, None)


def test_what_a_channel_says_of_itself_is_copied(tmp_path):
    data = write_replay_bytes(read_session(plain(tmp_path / "j.mcap"), None), [])
    [(_, channel, _)] = messages_of(data)
    assert dict(channel.metadata) == {"made": "by hand"}


@pytest.mark.parametrize("limit", ["MAXIMUM_CHUNK_BYTES", "MAXIMUM_UNCOMPRESSED_BYTES"])
def test_a_journal_that_unpacks_to_too_much_is_refused(tmp_path, monkeypatch, limit):
    path = plain(tmp_path / "j.mcap")
    monkeypatch.setattr(journal_file, limit, 50)
    with pytest.raises(BadInputError, match=r"\d+ bytes uncompressed"):
        read_session(path, None)


def test_a_journal_without_its_statistics_is_refused(tmp_path):
    with pytest.raises(BadInputError, match="no summary"):
        read_session(plain(tmp_path / "j.mcap", use_statistics=False), None)


def test_no_file_and_no_regular_file_are_refused(tmp_path):
    for path in (tmp_path / "none.mcap", tmp_path):
        with pytest.raises(IntegrityError, match="a regular file"):
            read_session(path, None)


@pytest.mark.parametrize(
    ("topic", "log_time", "said"),
    [
        ("/tcp", 5, "a message on /tcp that is no journal event"),
        ("/journal/teleport", 5, "/journal/teleport that is no journal event"),
        ("/journal/hold", 6, "log_time 6 of an event at 5"),
    ],
)
def test_mcap_that_is_no_journal_is_refused(tmp_path, topic, log_time, said):
    path = tmp_path / "j.mcap"
    with path.open("wb") as stream:
        writer = Writer(stream)
        writer.start()
        channel = writer.register_channel(topic, "json", 0)
        message = json.dumps({"session": "s", "n": 0, "t": 5, "reason": "empty"}).encode()
        writer.add_message(channel, log_time, message, log_time)
        writer.finish()
    with pytest.raises(BadInputError, match=said):
        read_session(path, None)


def test_an_empty_journal_is_refused(tmp_path):
    write_journal(tmp_path / "j.mcap", [])
    with pytest.raises(BadInputError, match="no event"):
        read_session(tmp_path / "j.mcap", None)
