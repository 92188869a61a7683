"""Documents that people and tools write, each place of them wrong: told, never a fault of ours.

Through the real commands. A wrong document is bad input (2) or refused (3), in one line that says
where, what was found, what is expected and what to do; what is refused has written nothing.
"""

import base64
import json
import shutil
import sys
from pathlib import Path

import pytest
import yaml

from gates import proof
from gates.commands import gates
from gates.pipeline import basis_of, changed_pages, check_record
from gates.present import present_runs
from gates.proof import SPECS
from gates.protection import require_protection
from gates.report import stage_of
from gates.settings import read_limits, read_settings, require_plain
from genpolicy.cli.shell import run_program
from genpolicy.errors import BadInputError

sys.path[:0] = [str(Path(__file__).parents[1]), str(Path(__file__).parent / "card")]

from damaged import broken_bytes, damaged  # noqa: E402
from team import PEOPLE, Team  # noqa: E402

ROOT = Path(__file__).parents[2]
CARD, ENVELOPE = "completed.json", "cards/trial.dsse.json"
SIGN = ("sign", "--card", CARD, "--key", "../keys/rita", "--reviewer", "rita")
CASES = {
    "params.yaml": ((("preregister",),), 60),
    "preregistration.yaml": ((("preregister",),), 10),
    "reviewers.yaml": ((("judge", "E"),), 4),
    CARD: ((SIGN,), 40),
    ENVELOPE: ((("judge", "E"),), 6),
    "reports/gate_a.json": ((("show", "A"),), 60),
    "reports/gate_d.json": ((("show", "D"),), 60),
}  # fmt: skip
"""By document: the commands that read it, and how many of its damages are tried."""


@pytest.fixture(scope="module")
def place(_ladder, tmp_path_factory):
    """A ladder with a signed card, the chain below it proved once."""
    root = tmp_path_factory.mktemp("damaged") / "repo"
    shutil.copytree(_ladder, root)
    chain = proof.prove_chain(root, "D")
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(proof, "prove_chain", lambda root, through: chain)
        team = Team(root)
        team.sign(team.complete(), PEOPLE)
    return root, chain


@pytest.fixture
def asked(place, capsys, monkeypatch):
    """Runs a command; what it says is checked here, since it is the same for all of them."""
    root, chain = place
    monkeypatch.chdir(root)

    def run(what, *words):
        if words[:2] == ("judge", "E") or words[0] == "sign":
            monkeypatch.setattr(proof, "prove_chain", lambda root, through: chain)
        before = files_of(root)
        code = run_program(gates, "gates", [*words, "--root", str(root)])
        printed = capsys.readouterr()
        said = printed.err.strip().splitlines()
        assert code in (0, 2, 3), (what, words, printed.err)
        assert "Traceback" not in printed.out + printed.err, (what, words)
        if code == 2:
            assert len(said) == 1 and said[0].startswith("gates "), (what, words, said)
            assert ", expected " in said[0] and said[0].endswith("."), (what, words, said)
            assert files_of(root) == before, (what, words)
        return code

    return run


def files_of(root):
    return {
        path: (path.stat().st_size, path.stat().st_mtime_ns)
        for path in root.rglob("*") if path.is_file()
    }  # fmt: skip


@pytest.mark.parametrize("name", CASES)
def test_a_document_with_one_place_wrong(name, place, asked):
    root, _ = place
    commands, limit = CASES[name]
    path, kept = root / name, (root / name).read_bytes()
    envelope, plan = (root / ENVELOPE).read_bytes(), (root / "preregistration.yaml").read_bytes()
    written_as_yaml = path.suffix == ".yaml"
    document = yaml.safe_load(kept) if written_as_yaml else json.loads(kept)
    tried = damaged(name, document, each=3, limit=limit, yaml_too=written_as_yaml)
    codes = []
    try:
        for what, data in [*tried, *broken_bytes(kept)]:
            path.write_bytes(data)
            codes += [asked(f"{name}: {what}", *words) for words in commands]
            if name != ENVELOPE:
                (root / ENVELOPE).write_bytes(envelope)
            (root / "preregistration.yaml").write_bytes(plan)
    finally:
        path.write_bytes(kept)
        (root / ENVELOPE).write_bytes(envelope)
        (root / "preregistration.yaml").write_bytes(plan)
    if commands[0][0] not in ("judge", "preregister"):  # a judge writes down what it finds
        assert codes.count(0) < len(codes) / 2, codes


def test_a_card_whose_payload_is_wrong_everywhere(place, asked):
    """Signed by real keys, past every check of the command that signs."""
    root, _ = place
    team, kept = Team(root), (root / ENVELOPE).read_bytes()
    payload = json.loads(base64.b64decode(json.loads(kept)["payload"]))
    try:
        for what, data in damaged("payload", payload, each=1, limit=8, yaml_too=False):
            team.write(data, tuple(PEOPLE))
            assert asked(what, "judge", "E") in (0, 2, 3)
    finally:
        (root / ENVELOPE).write_bytes(kept)


def test_parameters_that_gates_read():
    """Every place of `params.yaml`, for every gate; commands read them through these."""
    document = yaml.safe_load((ROOT / "params.yaml").read_text())
    refused = 0
    for what, data in damaged("params of gates", document, each=1, limit=120):
        try:
            params = yaml.safe_load(data)
            require_plain(params, where="params.yaml")
            if not isinstance(params, dict):
                continue
            for gate, spec in SPECS.items():
                read_settings(params, stage_of(gate), spec.settings)
                require_protection(params, gate)
                read_limits(params, gate, spec.criteria)
        except BadInputError as error:
            assert error.exit_code == 2 and error.where and error.expected, what
            refused += 1
    assert refused > 60


LOCKED = {
    "basis": lambda root: basis_of(root, "C"), "record": lambda root: check_record(root, "C", {}),
    "pages": lambda root: changed_pages(root, "C"), "present": present_runs,
}  # fmt: skip


@pytest.mark.parametrize("name", ["dvc.lock", "dvc.yaml"])
def test_what_recorded_the_runs(name, place):
    root, _ = place
    path, kept = root / name, (root / name).read_bytes()
    whole = json.loads(kept)["stages"]
    few = {"stages": {stage: whole[stage] for stage in ("shadow", "stress")}}
    tried = [*damaged(name, few, each=1, limit=40, yaml_too=False), *broken_bytes(kept)]
    refused = 0
    try:
        for what, data in tried:
            path.write_bytes(data)
            for reader, read in LOCKED.items():
                try:
                    read(root)
                except BadInputError as error:
                    assert error.where and error.action, (what, reader)
                    refused += 1
    finally:
        path.write_bytes(kept)
    assert refused > 20
