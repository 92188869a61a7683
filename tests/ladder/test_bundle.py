"""A bundle of a real ladder is proved on "another machine", and a forged one is not."""

import hashlib
import zipfile
from collections.abc import Callable
from pathlib import Path

import orjson
import pytest
import yaml

from gates.package.archive import INDEX_NAME, blob_name, read_index
from gates.package.bundling import BUNDLED, package
from gates.package.index import BundleIndex
from gates.package.proving import prove_bundle
from gates.package.statements import statement_path
from gates.proof import Rung
from genpolicy.errors import BadInputError, IntegrityError, RefusedError
from genpolicy.integrity.documents import canonical_json
from genpolicy.integrity.hashing import sha256_bytes

CANDIDATE = "flow"
ENTRY = {
    "name": "mine",
    "kind": "server",
    "author": "author@example.org",
    "address": "ws://127.0.0.1:1",
    "horizons": {
        "observation_horizon": 2, "prediction_horizon": 16, "execution_horizon": 8,
        "action_period_s": 0.05,
    },
    "observation": {"observation": {"channels": ["tcp_position_m"]}},
    "action": {
        "frame": "robot_base",
        "motion": "absolute",
        "position": {"columns": [0, 1, 2], "unit": "m"},
        "rotation": {"columns": [3, 4, 5, 6, 7, 8], "form": "rotation_6d"},
        "gripper": {"column": 9, "open": 1.0, "open_m": 1.0},
    },
}  # fmt: skip
Entries = dict[str, bytes]
Forge = Callable[[dict, Entries], None]


@pytest.fixture(scope="session")
def bundle(finished: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("bundle") / "flow.zip"
    package(finished, CANDIDATE, path)
    return path


def proved(path: Path, tmp_path: Path) -> tuple[BundleIndex, list[Rung]]:
    (tmp_path / "unpacked").mkdir()
    return prove_bundle(path, tmp_path / "unpacked")


def forged(path: Path, target: Path, forge: Forge) -> Path:
    """The bundle after a change, with every hash of its index made to fit."""
    with zipfile.ZipFile(path) as archive:
        entries = {name: archive.read(name) for name in archive.namelist()}
    index = orjson.loads(entries[INDEX_NAME])
    forge(index, entries)
    entries[INDEX_NAME] = canonical_json(index)
    named = {blob_name(file["sha256"]) for file in index["files"].values()}
    with zipfile.ZipFile(target, "w") as archive:
        for name, data in entries.items():
            if name in named or not name.startswith("blobs/"):
                archive.writestr(name, data)
    return target


def other_bytes(name: str, change: Callable[[bytes], bytes]) -> Forge:
    """A file with other bytes, named by their own hash."""

    def forge(index: dict, entries: Entries) -> None:
        data = change(entries[blob_name(index["files"][name]["sha256"])])
        index["files"][name] |= {"sha256": sha256_bytes(data), "size": len(data)}
        entries[blob_name(sha256_bytes(data))] = data

    return forge


def another_statement(index: dict, entries: Entries) -> None:
    statement = orjson.loads(entries[statement_path("D")])
    statement["predicate"]["caveats"] = []
    entries[statement_path("D")] = canonical_json(statement)
    index["statements"]["D"] = sha256_bytes(entries[statement_path("D")])


def smaller_groups(index: dict, entries: Entries) -> None:
    index["groups"][9]["files"] = index["groups"][9]["files"][:1]


def another_candidate(index: dict, entries: Entries) -> None:
    index["candidate"] = "diffusion"


def another_checkpoint(index: dict, entries: Entries) -> None:
    index["checkpoint"] = "0" * 64


def flipped(data: bytes) -> bytes:
    middle = len(data) // 2
    return data[:middle] + bytes([data[middle] ^ 1]) + data[middle + 1 :]


def better(data: bytes) -> bytes:
    return data.replace(b"PASS", b"FINE")


def more_files(index: dict, entries: Entries) -> None:
    index["files"]["reports/decision.html"] = {
        "sha256": sha256_bytes(b"signed"), "size": 6, "executable": False,
    }  # fmt: skip
    entries[blob_name(sha256_bytes(b"signed"))] = b"signed"


def other_unmeasured(index: dict, entries: Entries) -> None:
    """Whether the probes of a small ladder gave rows hangs on what it trained."""
    index["groups"][9]["unmeasured"] = "" if index["groups"][9]["unmeasured"] else "all"


def page_and_record(index: dict, entries: Entries) -> None:
    """A page with the record of it, which no report binds."""
    name = "reports/gate_d.md"
    page = entries[blob_name(index["files"][name]["sha256"])]
    old, new = (
        hashlib.md5(data, usedforsecurity=False).hexdigest().encode()
        for data in (page, better(page))
    )
    other_bytes(name, better)(index, entries)
    other_bytes("dvc.lock", lambda data: data.replace(old, new))(index, entries)


def test_a_bundle_is_proved_from_its_bytes_alone(
    bundle: Path, finished: Path, tmp_path: Path
) -> None:
    index, rungs = proved(bundle, tmp_path)
    assert {rung.gate: rung.verdict for rung in rungs} == index.verdicts
    assert index.verdicts == dict.fromkeys(BUNDLED, "PASS")
    package(finished, CANDIDATE, tmp_path / "again.zip")
    assert read_index(tmp_path / "again.zip").address == index.address
    assert (tmp_path / "again.zip").read_bytes() == bundle.read_bytes()


@pytest.mark.parametrize(
    ("forge", "said"),
    [
        (other_bytes("artifacts/stress/rollouts.parquet", flipped), "Gate D refuses"),
        (other_bytes("artifacts/ingest/frames.parquet", flipped), "Gate A refuses"),
        (other_bytes("reports/gate_d.html", better), "Gate D refuses"),
        (other_bytes("reports/gate_d/criteria.csv", better), "Gate D refuses"),
        (page_and_record, r"reports/gate_d\.md is another page"),
        (other_bytes("genpolicy/seeds.py", lambda data: data + b"\n"), "other code than runs here"),
        (another_statement, r"statements/gate_d\.json is not what"),
        (smaller_groups, "the groups is other than"),
        (other_unmeasured, "the groups is other than"),
        (more_files, r"beyond reports/decision\.html"),
        (another_candidate, "the checkpoint is another"),
        (another_checkpoint, "the checkpoint is another"),
    ],
)
def test_a_forged_bundle_is_not_proved(
    bundle: Path, tmp_path: Path, forge: Forge, said: str
) -> None:
    path = forged(bundle, tmp_path / "forged.zip", forge)
    with pytest.raises((IntegrityError, RefusedError), match=said):
        proved(path, tmp_path)


@pytest.mark.long
def test_a_verdict_that_the_evidence_does_not_give_is_refused(bundle: Path, tmp_path: Path) -> None:
    def worse(index: dict, entries: Entries) -> None:
        index["verdicts"]["D"] = "FAIL"

    _, rungs = proved(forged(bundle, tmp_path / "forged.zip", worse), tmp_path)
    assert [rung.gate for rung in rungs if rung.verdict == "REFUSED"] == ["D"]
    assert "the index says FAIL" in rungs[-1].note


def test_programs_that_are_brought_are_not_started_unasked(bundle: Path, tmp_path: Path) -> None:
    entry = yaml.safe_dump(ENTRY).encode()

    def brought(data: bytes) -> bytes:
        assert data.count(b"candidates: {}") == 1
        return data.replace(b"candidates: {}", b"candidates: {mine: own/mine.yaml}")

    def forge(index: dict, entries: Entries) -> None:
        other_bytes("params.yaml", brought)(index, entries)
        index["files"]["own/mine.yaml"] = {
            "sha256": sha256_bytes(entry), "size": len(entry), "executable": False,
        }  # fmt: skip
        entries[blob_name(sha256_bytes(entry))] = entry

    with pytest.raises(BadInputError, match=r"programs of mine.*--run-programs"):
        proved(forged(bundle, tmp_path / "forged.zip", forge), tmp_path)
