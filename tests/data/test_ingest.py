"""Many recordings at once: refusals listed, nothing dropped in silence."""

import json
from dataclasses import replace

import pytest

from genpolicy.data.ingest import ingest_recordings
from genpolicy.data.recording.writer import write_episode
from genpolicy.errors import ContractError
from genpolicy.evidence.documents.given import REFUSALS
from genpolicy.integrity.documents import canonical_json


def test_refusals_are_listed_and_nothing_is_dropped_silently(factory, tmp_path):
    good = [factory.episode(number) for number in range(5)]
    paths = factory.write_all(tmp_path, good)
    paths += [tmp_path / "copy.mcap", tmp_path / "cut.mcap", tmp_path / "renamed.mcap"]
    paths[5].write_bytes(paths[4].read_bytes())
    paths[6].write_bytes(paths[0].read_bytes()[:1000])
    other = "00000000-0000-0000-0000-00000000000f"
    write_episode(paths[7], replace(factory.episode(1), episode_uuid=other))
    paths.append(tmp_path / "absent.mcap")
    ingest_recordings(paths[::-1], contract=factory.contract(), out=tmp_path / "out")
    listed = json.loads((tmp_path / "out" / "refusals.json").read_text())
    assert listed["found"] == len(paths) == listed["accepted"] + len(listed["refused"])
    reasons = {item["file"]: item["reason"] for item in listed["refused"]}
    assert set(reasons) == {"absent.mcap", "e004.mcap", "cut.mcap", "renamed.mcap"}
    assert "shares its episode_uuid with copy.mcap" in reasons["e004.mcap"]
    assert "shares its samples with e001.mcap" in reasons["renamed.mcap"]
    assert all(item["where"].startswith(item["file"]) for item in listed["refused"])
    read = REFUSALS.read(tmp_path / "out")  # as gates read it, to the byte
    assert canonical_json(REFUSALS.plain(read)) == (tmp_path / "out/refusals.json").read_bytes()
    assert len(read.refused) == 4


def test_what_names_another_task_is_refused_where_a_task_is_asked_for(factory, tmp_path):
    mixed = [factory.episode(n, task="pour" if n == 3 else "reach") for n in range(5)]
    paths = factory.write_all(tmp_path, mixed)
    ingest_recordings(paths, contract=factory.contract(), out=tmp_path / "any")
    assert json.loads((tmp_path / "any" / "refusals.json").read_text())["accepted"] == 5
    ingest_recordings(paths, contract=factory.contract(), out=tmp_path / "one", task="reach")
    (refused,) = json.loads((tmp_path / "one" / "refusals.json").read_text())["refused"]
    assert refused["file"] == paths[3].name and "'pour'" in refused["reason"]
    assert "expected 'reach'" in refused["reason"]


def test_nothing_accepted_leaves_nothing_behind(factory, tmp_path):
    bad = tmp_path / "bad.mcap"
    bad.write_bytes(b"x")
    for files in ([bad], []):
        with pytest.raises(
            ContractError, match=rf"0 of {len(files)} recordings accepted"
        ) as caught:
            ingest_recordings(files, contract=factory.contract(), out=tmp_path / "out")
        assert caught.value.exit_code == 2
    assert [path.name for path in tmp_path.iterdir()] == ["bad.mcap"]


def test_too_few_for_three_splits(factory, tmp_path):
    paths = factory.write_all(tmp_path, [factory.episode(0), factory.episode(1)])
    with pytest.raises(ContractError, match="expected at least 3"):
        ingest_recordings(paths, contract=factory.contract(), out=tmp_path / "out")
    assert not (tmp_path / "out").exists()
