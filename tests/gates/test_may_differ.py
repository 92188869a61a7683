"""What may differ between methods: the list, what may never stand on it, and what prints."""

from pathlib import Path

import evidence
import pytest
import yaml
from asked import asked

from gates.may_differ import NEVER, PLACE, require_possible
from gates.need.simpler import baselines_matched
from gates.proof import SPECS
from gates.reproducibility.gate import unmatched_keys
from gates.settings import read_settings
from genpolicy.errors import ConfigError
from genpolicy.policies.checkpoint import CheckpointConfig
from genpolicy.policies.matched_training import matched_configuration, seed_folders
from genpolicy.policies.settings import SamplerConfig, TrainingConfig
from stages import task
from stages._stage import load_params

PARAMS = yaml.safe_load((Path(__file__).parents[2] / "params.yaml").read_text())
SHIPPED = dict(PARAMS["comparison"]["may_differ"])
RATE = "training.learning_rate"


def read(*entries, gate="B"):
    """The settings of a gate with these entries on the list."""
    params = {**evidence.PARAMS, "comparison": {"may_differ": list(entries)}}
    return read_settings(params, f"gate_{gate.lower()}", SPECS[gate].settings)


def listed(ladder, *entries):
    """The same ladder with these settings on the list."""
    evidence.write_params(ladder, lambda p: p["comparison"].update(may_differ=list(entries)))


def differs(ladder, stage, method, *keys):
    def change(document):
        document["differing_keys"][method] = list(keys)

    evidence.edit_document(ladder, f"{stage}/matched.json", change)


def test_what_is_on_the_list_may_differ_and_its_reason_prints(ladder):
    for gate, measure, who in (("A", baselines_matched, ()), ("B", unmatched_keys, ("flow",))):
        found = asked(ladder, measure, *who, gate=gate)
        assert (found.value, found.caveat) == (0.0, "differs where it may: head (what is compared)")


def test_what_is_not_on_the_list_counts_until_it_is_there_with_a_reason(ladder):
    differs(ladder, "train_generators", "flow", "head", RATE)
    differs(ladder, "train_baselines", "act", "head", RATE)
    for gate, measure, who in (("A", baselines_matched, ()), ("B", unmatched_keys, ("flow",))):
        found = asked(ladder, measure, *who, gate=gate)
        assert (found.value, found.caveat) == (1.0, f"{'act' if gate == 'A' else 'flow'}.{RATE}")
    listed(ladder, ["head", "what is compared"], [RATE, "tuned for each, 20 trials"])
    for gate, measure, who in (("A", baselines_matched, ()), ("B", unmatched_keys, ("flow",))):
        found = asked(ladder, measure, *who, gate=gate)
        assert found.value == 0.0
        assert found.caveat.endswith(f"; {RATE} (tuned for each, 20 trials)")


def test_where_nothing_differs_nothing_is_told(ladder):
    differs(ladder, "train_generators", "flow")
    assert asked(ladder, unmatched_keys, "flow", gate="B").caveat == "nothing differs"


def test_without_the_list_every_difference_counts(ladder):
    listed(ladder)
    assert asked(ladder, unmatched_keys, "flow", gate="B").value == 1.0


@pytest.mark.parametrize("gate", ["A", "B"])
@pytest.mark.parametrize("key", [*NEVER, "horizons.prediction_horizon", "provenance.x"])
def test_what_a_gain_would_be_a_gain_of_is_refused_on_the_list(gate, key):
    with pytest.raises(ConfigError, match=rf"^params\.yaml: {PLACE} .*{key} may never differ:"):
        read(["head", "what is compared"], [key, "we know what we do"], gate=gate)


@pytest.mark.parametrize(
    ("entries", "match"),
    [
        ([["head", "a"], ["head", "b"]], "head is listed twice"),
        ([["head", " "]], "pattern"), ([["", "a"]], "pattern"), ([["head"]], "Field required"),
        ([["a key", "a"]], "pattern"),
    ],
)  # fmt: skip
def test_an_entry_has_one_setting_and_a_reason(entries, match):
    with pytest.raises(ConfigError, match=match):
        read(*entries)


def test_names_that_only_begin_alike_are_others():
    assert len(read(["training.updates_of_another", "a"], ["horizonsx", "b"]).may_differ) == 2


def test_the_list_that_is_shipped_names_method_and_sampler_only():
    fields = {f"sampler.{name}" for name in SamplerConfig.model_fields}
    assert set(SHIPPED) == {"method", *fields - {"sampler.batch_rows"}}


def test_what_may_never_differ_stands_in_every_checkpoint():
    for key in NEVER:
        section, _, field = key.partition(".")
        assert section in CheckpointConfig.model_fields
        assert not field or (section == "training" and field in TrainingConfig.model_fields)


def test_methods_that_are_trained_together_differ_only_where_the_shipped_list_allows_it(fleet, kit):
    folders = seed_folders(fleet[0], list(kit.SAMPLERS), 0)
    found = matched_configuration(folders, reference="chunked_bc")["differing_keys"]
    assert {key for keys in found.values() for key in keys} <= set(SHIPPED)
    assert any(found.values())


@pytest.mark.parametrize(
    ("section", "found"),
    [
        ({"may_differ": [[never, "ours learns slowly"]]}, "may never differ") for never in NEVER
    ]
    + [(None, "should be an object"), ({"may_differ": [["head"]]}, "reason|items|required")],
)  # fmt: skip
def test_a_comparison_that_may_never_be_is_refused_before_anything_trains(section, found):
    require_possible(PARAMS["comparison"])
    with pytest.raises(ConfigError, match=rf"params\.yaml: comparison.*({found})"):
        require_possible(section)


def test_the_first_stage_asks_for_it(tmp_path, monkeypatch):
    impossible = {**PARAMS, "comparison": {"may_differ": [["training.updates", "x"]]}}
    (tmp_path / "params.yaml").write_text(yaml.safe_dump(impossible))
    monkeypatch.chdir(tmp_path)
    with pytest.raises(ConfigError, match=r"training\.updates may never differ"):
        task.work(load_params())
    assert not (tmp_path / "artifacts").exists()
