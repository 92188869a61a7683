"""The journal: append-only, there and back, same events same bytes, damage refused."""

import io
import json
import math
import sys
from pathlib import Path

import numpy as np
import pytest
from mcap.reader import make_reader

from genpolicy.errors import BadInputError, ContractError, IntegrityError
from genpolicy.evidence.shadow.rig import Rig
from genpolicy.execution.journal import (
    EVENT_FIELDS,
    Journal,
    decode_actions,
    encode_actions,
    read_journal,
    write_journal,
)
from genpolicy.verification.checker import check_journal

sys.path.insert(0, str(Path(__file__).parents[1]))
from viewer_rules import unread


def played(name):
    rig = Rig(session=name)
    for _ in range(3):
        rig.run()
    rig.executor.force_event(rig.now_s)
    rig.supervisor.emergency_stop(rig.now_s)
    rig.tick(2)
    rig.end()
    return rig.journal


def test_there_and_back(tmp_path):
    journals = [played("a"), played("b")]
    write_journal(tmp_path / "j.mcap", journals)
    assert read_journal(tmp_path / "j.mcap") == {j.session: j.events() for j in journals}


def test_same_events_same_bytes(tmp_path):
    for name in ("1", "2"):
        write_journal(tmp_path / name, [played("a")])
    assert (tmp_path / "1").read_bytes() == (tmp_path / "2").read_bytes()


def test_the_file_is_plain_mcap_with_event_time_as_log_time(tmp_path):
    """Golden: one event, as any MCAP reader sees it."""
    journal = Journal("s")
    journal.invocation(1.5, invocation_id="i-1", stage="begin")
    write_journal(tmp_path / "j.mcap", [journal])
    reader = make_reader(io.BytesIO((tmp_path / "j.mcap").read_bytes()), validate_crcs=True)
    [(schema, channel, message)] = list(reader.iter_messages())
    assert (channel.topic, channel.message_encoding) == ("/journal/invocation", "json")
    assert (schema.encoding, schema.name) == ("jsonschema", "genpolicy.journal.invocation")
    assert (message.log_time, message.publish_time, message.sequence) == (1_500_000_000,) * 2 + (0,)
    expected = b'{"session":"s","n":0,"t":1500000000,"id":"i-1","stage":"begin","detail":""}'
    assert message.data == expected


def test_a_viewer_reads_every_channel(tmp_path):
    write_journal(tmp_path / "j.mcap", [played("a")])
    assert unread((tmp_path / "j.mcap").read_bytes()) == ({}, len(EVENT_FIELDS))


def test_every_event_has_the_fields_of_its_kind():
    seen = set()
    for event in played("a").events():
        assert set(event.payload) == set(EVENT_FIELDS[event.kind]), event.kind
        json.dumps(event.payload, allow_nan=False)
        seen.add(event.kind)
    assert len(seen) >= 10


def test_actions_keep_every_bit():
    values = np.array([[0.1, -0.0, math.nan, math.inf, 5e-324, 1 / 3, 1e300, -1.0, 0.0, 2.0]])
    assert decode_actions(encode_actions(values)).tobytes() == values.tobytes()
    assert encode_actions(np.array([[1.0] + [0.0] * 9]))[:16] == "000000000000f03f"


def test_two_sessions_of_one_name_are_refused(tmp_path):
    with pytest.raises(ContractError, match="unique session names"):
        write_journal(tmp_path / "j.mcap", [Journal("a"), Journal("a")])
    assert not (tmp_path / "j.mcap").exists()


def test_damage_is_refused(tmp_path):
    path = tmp_path / "j.mcap"
    write_journal(path, [played("a")])
    whole = path.read_bytes()
    for data in (b"", b"\x00" * 100, whole[:-20], whole[: len(whole) // 2], whole[10:]):
        path.write_bytes(data)
        with pytest.raises(BadInputError, match="whole MCAP journal"):
            read_journal(path)
    with pytest.raises(IntegrityError):
        read_journal(tmp_path / "missing.mcap")


@pytest.mark.parametrize("read", [read_journal, check_journal])
def test_a_small_file_that_swells_beyond_a_record_is_refused(tmp_path, read):
    path, journal = tmp_path / "j.mcap", Journal("a")
    journal.add("hold", 0, {"reason": "a" * (65 << 20)})
    write_journal(path, [journal])
    assert path.stat().st_size < 1 << 20
    with pytest.raises(BadInputError, match="whole MCAP journal"):
        read(path)


def test_the_newest_event_of_a_kind():
    journal = Journal("s")
    assert journal.last("hold") is None
    for reason in ("a", "b"):
        journal.add("hold", 0, {"reason": reason})
    journal.add("force", 0, {"force_n": 1.0})
    assert journal.last("hold", "accept") == {"reason": "b"}
    assert journal.last("force", "hold") == {"force_n": 1.0}
