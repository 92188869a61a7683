"""A device is said in one place, `compute.device`, and whoever loads a policy hands it on."""

import ast
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]
LOADS = {"load_policy", "NetworkPolicy", "measure_policy"}
ON_THE_CPU = {
    "genpolicy/policies/matched_training.py",  # draws the fixtures, on the CPU whatever trains
    "genpolicy/policies/fixtures.py",  # draws them again there
    "genpolicy/cli/programs.py",  # writes a program, which is traced there
}
STAGES = (
    "measure_baselines", "measure_factors", "reload", "latency", "shadow", "wall_clock", "stress",
    "monitors", "failure_search",
)  # fmt: skip


def calls(tree):
    for node in ast.walk(tree):
        if isinstance(node, ast.Call):
            name = getattr(node.func, "id", getattr(node.func, "attr", ""))
            yield name, {word.arg: word.value for word in node.keywords}


def found_in(text, place):
    """What a file does wrong, in words."""
    wrong = []
    for name, words in calls(ast.parse(text)):
        device = words.get("device")
        if name in LOADS and device is None and place not in ON_THE_CPU:
            wrong.append(f"{name} without a device")
        if isinstance(device, ast.Constant):
            wrong.append(f"{name} on {device.value!r}, written there")
    return wrong


def sources():
    for package in ("genpolicy", "stages", "gates"):
        for path in sorted((ROOT / package).rglob("*.py")):
            yield path.relative_to(ROOT).as_posix(), path.read_text()


def test_nobody_loads_a_policy_without_a_device_or_on_one_of_its_own_choice():
    wrong = {place: said for place, text in sources() if (said := found_in(text, place))}
    assert not wrong


def test_who_is_excepted_does_load():
    for place in ON_THE_CPU:
        assert any(name in LOADS for name, _ in calls(ast.parse((ROOT / place).read_text()))), place


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("load_policy(folder)", ["load_policy without a device"]),
        ("NetworkPolicy(c, sampler=s)", ["NetworkPolicy without a device"]),
        ("trained(r, n, seeds=s, device='cpu')", ["trained on 'cpu', written there"]),
        ("load_policy(folder, device=self.device)", []),
    ],
)
def test_the_search_finds_what_it_is_for(text, said):
    assert found_in(text, "stages/any.py") == said


@pytest.mark.parametrize("stage", STAGES)
def test_a_stage_that_asks_a_policy_takes_the_device_from_the_parameters(stage):
    text = (ROOT / "stages" / f"{stage}.py").read_text()
    listings = {"trained", "in_comparison", "admitted_contenders"}
    given = [words for name, words in calls(ast.parse(text)) if name in listings]
    assert given and all("device" in words for words in given)
    assert "params.compute.device" in text
    pipeline = (ROOT / "dvc.yaml").read_text().partition(f"\n  {stage}:\n")[2]
    assert "- compute.device\n" in pipeline.partition("\n    outs:")[0]
