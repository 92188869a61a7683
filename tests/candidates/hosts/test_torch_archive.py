"""Planted archives: whatever they hold, nothing of it runs."""

import io
import json

import pytest
import torch

from genpolicy.candidates.hosts.torch_archive import GRAPH, SAMPLES, without_code
from genpolicy.errors import IntegrityError
from tests.candidates.hosts.conftest import member, replant

WEIGHTS, CONSTANTS = (
    "data/weights/model_weights_config.json",
    ("data/constants/model_constants_config.json"),
)


def pickle_that_writes(path):
    """By hand: `os.system('touch path')` when it is unpickled."""
    return f"cos\nsystem\n(S'touch {path}'\ntR.".encode()


def with_config(data, config, name, change, **members):
    said = json.loads(member(data, config))
    said["config"][name] = {**said["config"].get(name, {}), **change}
    return replant(data, {config: json.dumps(said).encode(), **members})


def with_graph(data, change):
    graph = json.loads(member(data, GRAPH))
    change(graph)
    return replant(data, {GRAPH: json.dumps(graph).encode()})


def graph_of(graph):
    return graph["graph_module"]["graph"]


def planted(data, marker):
    """Archives that run something when torch opens them, by what is wrong with them."""
    evil = pickle_that_writes(marker)
    payload = {"path_name": "weight_0", "is_param": True, "use_pickle": True, "tensor_meta": None}
    return {
        "weight": with_config(
            data, WEIGHTS, "layer.weight", payload, **{"data/weights/weight_0": evil}
        ),
        "constant": with_config(
            data, CONSTANTS, "c", {**payload, "path_name": "tensor_0"},
            **{"data/constants/tensor_0": evil},
        ),
        "opaque": with_config(
            data, CONSTANTS, "c", {**payload, "path_name": "opaque_obj_0"},
            **{"data/constants/opaque_obj_0": evil},
        ),
        "guard": with_graph(data, lambda graph: graph.update(guards_code=["__import__('os')"])),
    }  # fmt: skip


@pytest.mark.parametrize("what", ["weight", "constant", "opaque"])
def test_a_pickle_among_weights_and_constants_is_refused_and_does_not_run(
    torch_data, tmp_path, what
):
    marker = tmp_path / "ran"
    archive = planted(torch_data, marker)[what]
    with pytest.raises(IntegrityError, match="stored as a pickle"):
        without_code(archive, where="policy.pt2")
    assert not marker.exists()


@pytest.mark.filterwarnings("ignore")
def test_the_planted_pickles_run_where_torch_opens_them(torch_data, tmp_path):
    """So that the refusals above are of something."""
    for what, archive in (
        ("weight", planted(torch_data, tmp_path / "weight")["weight"]),
        ("samples", replant(torch_data, {SAMPLES: pickle_that_writes(tmp_path / "samples")})),
    ):
        with pytest.raises(Exception):  # noqa: B017  what it says does not matter
            torch.export.load(io.BytesIO(archive))
        assert (tmp_path / what).exists()


def test_sample_inputs_are_never_opened(torch_data, tmp_path):
    marker = tmp_path / "ran"
    assert member(torch_data, SAMPLES)  # as torch writes them, a pickle
    clean = without_code(replant(torch_data, {SAMPLES: pickle_that_writes(marker)}), where="p")
    assert member(clean, SAMPLES) == b""
    torch.export.load(io.BytesIO(clean))
    assert not marker.exists()


def test_the_copy_is_the_program_without_its_source(torch_data):
    clean = without_code(torch_data, where="policy.pt2")
    assert without_code(clean, where="copy") == clean
    assert b"stack_trace" in torch_data
    assert b"stack_trace" not in clean
    given = (torch.ones(2, 24, dtype=torch.float64), torch.ones(16, 10))
    before, after = (torch.export.load(io.BytesIO(data)).module() for data in (torch_data, clean))
    assert torch.equal(before(*given), after(*given))


def test_guards_are_left_out(torch_data, tmp_path):
    clean = without_code(planted(torch_data, tmp_path)["guard"], where="policy.pt2")
    assert json.loads(member(clean, GRAPH))["guards_code"] == []


def retarget(target):
    return lambda graph: graph_of(graph)["nodes"][-1].update(target=target)


def rename(graph):
    graph_of(graph)["nodes"][-1]["name"] = "x\nimport os"


def expression(graph):
    graph_of(graph)["sym_int_values"] = {"s0": {"as_expr": {"expr_str": "__import__('os')"}}}


def structured(graph):
    call = graph["graph_module"]["module_call_graph"][0]["signature"]
    call["in_spec"] = json.dumps([1, {"type": "collections.defaultdict", "context": '["os","x"]'}])


@pytest.mark.parametrize(
    ("change", "found"),
    [
        (retarget("torch.serialization.os.system"), "calls 'torch.serialization.os.system'"),
        (retarget("torch.load"), "calls 'torch.load'"),
        (retarget("torch.ops.aten.from_file.default"), "calls 'torch.ops.aten.from_file"),
        (retarget("math.sqrt"), "calls 'math.sqrt'"),
        (retarget("#extension:x"), "calls '#extension"),
        (rename, "which is no name"),
        (expression, "as_expr"),
        (structured, "collections.defaultdict"),
        (lambda graph: graph.update(range_constraints={"s0": {}}), "sizes are not fixed"),
    ],
)
def test_a_graph_that_says_more_than_a_graph_is_refused(torch_data, change, found):
    with pytest.raises(IntegrityError) as error:
        without_code(with_graph(torch_data, change), where="policy.pt2")
    assert found in error.value.found


@pytest.mark.parametrize(
    ("changes", "found"),
    [
        ({GRAPH: b"[]"}, "no map"),
        ({GRAPH: b"{"}, "not JSON"),
        ({WEIGHTS: b'{"config": {"a": {"use_pickle": false, "path_name": "../x"}}}'}, "pickle"),
        (
            {WEIGHTS: b'{"config": {"a": {"use_pickle": false, "path_name": "weight_9"}}}'},
            "weight_9",
        ),
        ({WEIGHTS: b'{"config": [1]}'}, "no map"),
        ({WEIGHTS: b'{"config": {"a": 1}}'}, "no map"),
    ],
)
def test_an_archive_that_is_none(torch_data, changes, found):
    with pytest.raises(IntegrityError) as error:
        without_code(replant(torch_data, changes), where="policy.pt2")
    assert found in error.value.found


@pytest.mark.parametrize("data", [b"", b"PK", b"\x80\x02}q\x00."])
def test_another_file_is_no_archive(data):
    with pytest.raises(IntegrityError, match="no archive"):
        without_code(data, where="policy.pt2")


@pytest.mark.parametrize("context", [
    '{"__enum__": true, "fqn": "this:s", "name": 0}',
    '[{"__enum__": true, "fqn": "this:s", "name": 0}]',
    {"__enum__": True, "fqn": "this:s", "name": 0},
])  # fmt: skip
def test_a_structure_that_names_a_module_is_refused(torch_data, context):
    """torch imports what such a context names."""

    def change(graph):
        for signature in graph["graph_module"]["module_call_graph"]:
            if signature["signature"] is None:
                continue
            said = json.loads(signature["signature"]["in_spec"])
            said[1]["context"] = context
            signature["signature"]["in_spec"] = json.dumps(said)

    with pytest.raises(IntegrityError, match="more than names"):
        without_code(with_graph(torch_data, change), where="policy.pt2")
