import datetime
import re
import shutil
from pathlib import Path

import pytest
import torch
import yaml

from benchmarks.candidates import SAMPLER
from gates.exceptions import require_unmatched, unmatched_written, utc_today
from gates.floors import LONGEST_DAYS
from genpolicy.candidates.brought import BroughtSection, require_brought
from genpolicy.candidates.hosts import onnx_library
from genpolicy.candidates.hosts.kinds import KINDS, chosen, read_entry
from genpolicy.candidates.hosts.translation import as_server
from genpolicy.candidates.wire.declared import Choice
from genpolicy.candidates.wire.entry import verify_files
from genpolicy.errors import ConfigError, IntegrityError
from genpolicy.policies.settings import SamplerConfig
from tests.candidates.conftest import ENTRY
from tests.candidates.hosts.conftest import NOISE

HOSTED = ("trained", "torch", "onnx", "scripted", "lerobot")
DECLARED = {
    "dataset": "0" * 64, "split": "0" * 64, "training_seed": 1, "architecture": "a",
    "parameters": 1, "path": "p", "sampler": "euler", "sampler_steps": 2, "evaluations": 2,
    "precision": "float32", "device": "cpu", "threads": 4, "cpu_capability": "AVX2",
    "batch_rows": 1,
}  # fmt: skip

ALONE = {**DECLARED, "threads": 1}
ANOTHER = {"two_steps": {"sampler": "euler", "sampler_steps": 2}}
OBSERVED = ENTRY["observation"]["observation"]


@pytest.mark.parametrize("kind", HOSTED)
def test_each_kind_is_read_with_its_files(written, kind):
    path = written(kind)
    entry = read_entry(path)
    assert type(entry) is KINDS[kind]
    assert entry.started_here
    verify_files(entry, path.parent)


@pytest.mark.parametrize("kind", HOSTED)
def test_a_file_that_is_the_candidate_must_be_pinned(written, kind):
    path = written(kind)
    entry = read_entry(path)
    for name in entry.files:
        rest = {other: digest for other, digest in entry.files.items() if other != name}
        fewer = read_entry(written(kind, files=rest))
        with pytest.raises(ConfigError, match="without") as error:
            verify_files(fewer, path.parent)
        assert name in error.value.found
    changed = path.parent / next(iter(entry.files))
    changed.write_bytes(b"another")
    with pytest.raises(IntegrityError, match="the entry of planted"):
        verify_files(entry, path.parent)


def test_all_that_lerobot_reads_must_be_pinned(written):
    path = written("lerobot")
    entry = read_entry(path)
    folder = path.parent / "act"
    (folder / "train_config.json").write_text("{}")
    verify_files(entry, path.parent)
    (folder / "policy_postprocessor_step_0.safetensors").write_bytes(b"statistics")
    with pytest.raises(ConfigError, match="act/policy_postprocessor_step_0"):
        verify_files(entry, path.parent)


def test_an_unknown_kind_names_the_known_ones(written):
    path = written("torch")
    path.write_text(path.read_text().replace("kind: torch", "kind: pickle"))
    with pytest.raises(ConfigError, match="server, trained, torch, onnx, lerobot, scripted"):
        read_entry(path)


@pytest.mark.parametrize(
    ("kind", "changes", "expected"),
    [
        ("torch", {"noise": None}, "stochastic: true needs `noise`"),
        ("torch", {"stochastic": False}, "and false none"),
        ("torch", {"noise": {**NOISE, "input": "observation"}}, "observation is given twice"),
        ("torch", {"constants": {"prompt": "go"}}, "no constants"),
        ("torch", {"declared": DECLARED}, "threads is 1, declared.threads 4"),
        ("torch", {"declared": {**ALONE, "device": "cuda"}}, "programs run on the cpu here"),
        ("trained", {"threads": 2}, "Input should be 1"),
        ("trained", {"observation": {"state": ENTRY["observation"]["observation"]}}, "one input"),
        ("trained", {"observation": {"observation": {**OBSERVED, "dtype": "float32"}}}, "float64"),
        ("trained", {"observation": {"observation": {**OBSERVED, "unit": "mm"}}}, "lengths in m"),
        ("trained", {"observation": {"observation": {**OBSERVED, "history": 1}}}, "its 2 last"),
        ("scripted", {"function": "os.path:join"}, "pattern"),
        ("torch", {"address": "ws://127.0.0.1:1"}, "fields of a candidate"),
        ("torch", {"noise": {**NOISE, "stream": "12"}}, "pattern"),
        ("torch", {"samplers": ANOTHER}, "samplers: a program is written out with one"),
        ("scripted", {"samplers": ANOTHER}, "samplers: a function has no settings"),
        ("lerobot", {"samplers": ANOTHER}, "samplers: a policy of LeRobot is asked as its"),
    ],
)
def test_what_is_wrong_is_named(written, kind, changes, expected):
    with pytest.raises(ConfigError) as error:
        read_entry(written(kind, **changes))
    assert expected in error.value.expected


def test_what_nothing_here_can_run_is_refused_before_anything_trains(
    written, tmp_path, monkeypatch
):
    for kind in ("trained", "torch", "onnx", "scripted"):
        read_entry(written(kind)).require_host()
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(onnx_library, "find_spec", lambda name: None)
    for kind, action in (("onnx", "pip install"), ("lerobot", "make lerobot")):
        path = written(kind)
        with pytest.raises(ConfigError, match=action):
            require_brought({"planted": str(path)}, horizons=read_entry(path).horizons)


def test_a_device_that_is_declared_and_not_there_is_refused_before_anything_trains(
    written, task, monkeypatch
):
    monkeypatch.setattr(torch.cuda, "device_count", lambda: 0)
    path = written("trained", declared={**ALONE, "device": "cuda"})
    entry = read_entry(path)
    assert entry.device == "cuda" and read_entry(written("scripted")).device == "cpu"
    for ask in (
        lambda: require_brought({"planted": str(path)}, horizons=entry.horizons),
        lambda: as_server(entry, path, task.observation),
    ):
        with pytest.raises(
            ConfigError, match=r"declared\.device of the candidate planted is 'cuda'"
        ):
            ask()


@pytest.mark.parametrize("device", ["NVIDIA A100", "cuda"])
def test_lerobot_is_put_on_a_device_that_is_here(written, tmp_path, monkeypatch, device):
    monkeypatch.setattr(torch.cuda, "device_count", lambda: 0)
    monkeypatch.chdir(tmp_path)
    entry = read_entry(written("lerobot", declared={**DECLARED, "device": device}))
    with pytest.raises(ConfigError, match=r"declared\.device of the candidate planted"):
        entry.require_host()


def test_a_choice_inherits_nothing_that_it_could_have_said():
    """Wrong before: dpm_2m took the eta of the judged ddim, which no such sampler has."""
    own = SamplerConfig(name="ddim", steps=4, eta=0.5, tolerance=0.01, clip=2.0, nfe_cap=9)
    found = chosen(own, Choice(sampler="dpm_2m", sampler_steps=2), where="samplers.a")
    assert found == SamplerConfig(name="dpm_2m", steps=2, clip=2.0)
    same = Choice(sampler="ddim", sampler_steps=4, nfe_cap=7)
    assert chosen(own, same, where="").model_dump(include={"eta", "nfe_cap"}) == {
        "eta": 0.0, "nfe_cap": 7,
    }  # fmt: skip


@pytest.mark.parametrize("choice", [{"sampler": "ddim"}, {"sampler": "euler", "eta": 0.5},
                                    {"sampler": "unknown"}])  # fmt: skip
def test_a_setting_that_its_checkpoint_cannot_have_is_refused_when_it_is_read(
    written, fleet, choice
):
    path = written("trained", samplers={"a": {**choice, "sampler_steps": 2}})
    shutil.copy(fleet[0] / "flow/seed_0/config.json", path.parent / "flow/config.json")
    with pytest.raises(ConfigError, match=r"samplers\.a"):
        read_entry(path)


def test_noise_of_several_steps_has_an_axis_more(written):
    noise = read_entry(written("torch", noise={**NOISE, "steps": 5})).noise
    assert noise.whole_shape == (5, 16, 10)
    assert read_entry(written("torch")).noise.whole_shape == (16, 10)


DOCS = (Path(__file__).parents[3] / "docs" / "candidates.md").read_text()
BLOCKS = re.findall(r"```yaml\n(.*?)```", DOCS, re.DOTALL)
OF_THE_LADDER = "params.yaml"


def named(block):
    """What a block of the docs begins with: the name of its file, or its first key."""
    return re.match(r"(?:# )?([\w.]+)", block)[1]


def said(block):
    return yaml.safe_load(re.sub(r"@\w+@", "0" * 64, block))


def test_every_block_of_the_docs_is_looked_at():
    assert {named(block) for block in BLOCKS} == {
        "candidate.yaml", "joints", "trained.yaml", "torch.yaml", "scripted.yaml", OF_THE_LADDER,
        "declared", "samplers", "lerobot.yaml",
    }  # fmt: skip


def test_the_docs_name_the_policy_of_which_the_table_of_kinds_is():
    [said] = re.findall(r"`python -m benchmarks\.candidates`, (medians .*)", DOCS)
    assert f"untrained diffusion of the configured size, {SAMPLER.steps} DDIM steps" in said
    assert SAMPLER.name == "ddim"


@pytest.mark.parametrize("today", [utc_today(), datetime.date(2099, 12, 1)])
def test_the_exception_of_the_docs_holds_on_whatever_day_it_is_read(today):
    """No day stands there that is over some day: who copies it is asked for one of his own."""
    [block] = [one for one in BLOCKS if named(one) == OF_THE_LADDER]
    section = yaml.safe_load(block)["gate_b"]
    with pytest.raises(ConfigError, match=r"gate_b\.unmatched\.my_flow.*@day@"):
        unmatched_written({"gate_b": section})
    last = str(today + datetime.timedelta(days=LONGEST_DAYS))
    written = unmatched_written(yaml.safe_load(block.replace("@day@", last)))
    require_unmatched(written, today, brought={"my_flow"})


@pytest.mark.parametrize("block", BLOCKS, ids=named)
def test_every_entry_and_every_part_of_one_in_the_docs_is_read(block, tmp_path):
    fields = said(block)
    if named(block) == OF_THE_LADDER:
        assert BroughtSection.model_validate(fields["candidates"]).root.keys() == {"my_flow"}
        return
    [whole] = [said(one) for one in BLOCKS if named(one) == "candidate.yaml"]
    if "kind" in fields:
        del whole["command"]
    path = tmp_path / "candidate.yaml"
    path.write_text(yaml.safe_dump({**whole, **fields}))
    read = read_entry(path).model_dump(mode="json", exclude_unset=True)
    assert read.keys() >= fields.keys()
