"""One name for a stage, its file, its section, its folder; thresholds with reason and owner."""

from functools import cache
from pathlib import Path, PurePosixPath

import pytest
import yaml
from _beside import BESIDE

from flows.ladder import GATES, stages_by_gate
from flows.workspace import declared_outputs, merged

ROOT = Path(__file__).parents[2]
OWNERS = {"model", "perception", "controller", "safety"}


@cache
def pipeline() -> dict:
    return yaml.safe_load((ROOT / "dvc.yaml").read_text()) or {}


@cache
def params() -> dict:
    return yaml.safe_load((ROOT / "params.yaml").read_text())


def stages() -> list[str]:
    return list(pipeline().get("stages") or {})


def test_every_gate_ends_a_row_of_stages() -> None:
    assert tuple(stages_by_gate(pipeline())) == GATES


@pytest.mark.parametrize("stage", stages() or ["a stage in dvc.yaml"])
def test_a_stage_its_file_its_section_and_its_folder_have_one_name(stage: str) -> None:
    definition = pipeline()["stages"][stage]
    assert definition["cmd"] == f"python -m stages.{stage}"
    assert (ROOT / "stages" / f"{stage}.py").is_file()
    home = BESIDE.get(stage, stage)
    assert home.split(".")[0] in params(), f"params.yaml has no section {stage}"
    used = {f"{entry}.".startswith(f"{home}.") for entry in definition.get("params") or ()}
    assert True in used, f"stage {stage} does not depend on its own section"
    outputs = declared_outputs({"stages": {stage: definition}})
    assert outputs, f"stage {stage} declares no output"
    for name in outputs:
        parts = PurePosixPath(name).parts
        own_folder = parts[:2] == ("artifacts", stage)
        own_report = parts[0] == "reports" and parts[-1].split(".")[0] == stage
        assert own_folder or own_report, f"stage {stage} writes {name}"


def test_a_stage_comes_after_what_it_reads() -> None:
    made: set[str] = set()
    known = set(declared_outputs(pipeline()))
    for stage, definition in pipeline()["stages"].items():
        for dep in definition["deps"]:
            later = [out for out in known - made if out == dep or out.startswith(f"{dep}/")]
            later += [out for out in known - made if dep.startswith(f"{out}/")]
            assert not later, f"stage {stage} reads {dep}, which a later stage writes: {later}"
        made |= set(declared_outputs({"stages": {stage: definition}}))


def test_a_stage_behind_a_gate_depends_on_what_the_gate_found() -> None:
    gate = ""
    for stage, definition in pipeline()["stages"].items():
        if gate and not stage.startswith("gate_"):
            assert any(gate in dep for dep in definition["deps"]), (
                f"stage {stage} stands behind {gate} and does not depend on it"
            )
        gate = stage if stage.startswith("gate_") else gate


@pytest.mark.parametrize("gate", [f"gate_{letter}" for letter in GATES])
def test_every_limit_has_a_reason_and_an_owner(gate: str) -> None:
    limits = params()[gate]["limits"]
    assert limits, f"{gate} has no limit, so nothing could fail"
    assert set(limits) <= set(OWNERS), gate
    for entries in limits.values():
        for name, (limit, reason) in entries.items():
            assert isinstance(limit, int | float) or limit == "derived", f"{gate}.{name}"
            assert len(reason.split()) >= 3, f"{gate}.{name} gives no reason"


def test_the_smoke_ladder_overrides_only_what_exists_and_says_why_a_limit_differs() -> None:
    overrides = yaml.safe_load((ROOT / "params.smoke.yaml").read_text())
    merged(params(), overrides)
    for gate in (f"gate_{letter}" for letter in GATES):
        for owner, entries in overrides.get(gate, {}).get("limits", {}).items():
            for name, (_, reason) in entries.items():
                ours = params()[gate]["limits"][owner][name][1]
                assert reason != ours, f"{gate}.{name} gives no reason of its own"


def test_the_settings_are_few_enough_to_be_read() -> None:
    def leaves(value: object) -> int:
        return sum(map(leaves, value.values())) if isinstance(value, dict) else 1

    assert leaves(params()) <= 270
