import numpy as np
import pytest
from onnx import TensorProto, helper

from genpolicy.candidates.hosts.onnx_program import OnnxProgram
from genpolicy.candidates.hosts.ports import Port
from genpolicy.errors import ContractError, IntegrityError
from tests.candidates.hosts.conftest import onnx_model


def nothing_beside(name):
    raise AssertionError(name)


def loaded(data, external=nothing_beside, threads=1):
    return OnnxProgram(data, where="policy.onnx", threads=threads, external=external)


def add(name="actions"):
    return helper.make_node("Add", ["noise", "weight"], [name])


def outside(model, **said):
    """The weight in a file beside it."""
    [weight] = model.graph.initializer
    weight.ClearField("float_data")
    weight.ClearField("raw_data")
    weight.data_location = TensorProto.EXTERNAL
    for key, value in said.items():
        weight.external_data.add(key=key, value=str(value))
    return model.SerializeToString()


def test_it_says_what_it_takes_and_gives_and_computes_it(onnx_data):
    program = loaded(onnx_data)
    assert program.inputs == {
        "observation": Port((2, 24), "float64"), "noise": Port((16, 10), "float32"),
    }  # fmt: skip
    noise = np.ones((16, 10), np.float32)
    found = program.run({"observation": np.zeros((2, 24)), "noise": noise})
    assert (found == noise + 2.0 * np.arange(10, dtype=np.float32)).all()
    assert program.uses("weight") == 2
    assert program.uses("noise") is None


def test_one_thread_in_one_order_unless_the_entry_says_otherwise(onnx_data):
    for threads in (1, 2):
        options = loaded(onnx_data, threads=threads)._session.get_session_options()
        assert (options.intra_op_num_threads, options.inter_op_num_threads) == (threads, threads)
        assert str(options.execution_mode).endswith("ORT_SEQUENTIAL")
        assert loaded(onnx_data)._session.get_providers() == ["CPUExecutionProvider"]


def test_tensors_of_a_file_beside_it_come_from_verified_bytes():
    data = np.arange(12, dtype=np.float32).tobytes()
    model = outside(onnx_model(), location="weights.bin", offset=8, length=40)
    asked = []

    def external(name):
        asked.append(name)
        return data

    found = loaded(model, external).run(
        {"observation": np.zeros((2, 24)), "noise": np.zeros((16, 10), np.float32)}
    )
    assert asked == ["weights.bin"]
    assert (found[0] == 2.0 * np.arange(2, 12)).all()
    with pytest.raises(IntegrityError, match="behind its file"):
        loaded(outside(onnx_model(), location="weights.bin", offset=16, length=40), lambda _: data)


@pytest.mark.parametrize(
    ("model", "found"),
    [
        (onnx_model(domain="somebody"), "somebody::Add"),
        (
            onnx_model([
                helper.make_node("RandomNormalLike", ["noise"], ["x"]),
                helper.make_node("Add", ["x", "weight"], ["actions"]),
            ]),
            "RandomNormalLike, which draws by itself",
        ),
        (onnx_model([helper.make_node("Nothing", ["noise"], ["actions"])]), "Nothing"),
    ],
)  # fmt: skip
def test_operators_of_others_and_draws_are_refused(model, found):
    with pytest.raises(IntegrityError) as error:
        loaded(model.SerializeToString())
    assert found in error.value.found


def test_draws_in_a_branch_are_found_and_uses_of_a_branch_are_not_counted():
    def branch(node):
        value = helper.make_tensor_value_info("out", TensorProto.FLOAT, [16, 10])
        return helper.make_graph([node], "branch", [], [value])

    def model(*nodes):
        condition = helper.make_tensor("yes", TensorProto.BOOL, [], [True])
        return onnx_model([
            helper.make_node("Constant", [], ["yes"], value=condition),
            helper.make_node("If", ["yes"], ["actions"], then_branch=branch(nodes[0]),
                             else_branch=branch(nodes[1])),
        ]).SerializeToString()  # fmt: skip

    assert loaded(model(add("out"), add("out"))).uses("weight") is None
    drawing = helper.make_node("RandomNormalLike", ["noise"], ["out"])
    with pytest.raises(IntegrityError, match="draws by itself"):
        loaded(model(add("out"), drawing))


def test_what_is_no_file_of_onnx_and_more_than_one_output():
    with pytest.raises(IntegrityError, match="standard operators"):
        loaded(b"no model")
    both = onnx_model([add("a"), add("b")], a=[16, 10], b=[16, 10])
    with pytest.raises(ContractError, match="2 outputs"):
        loaded(both.SerializeToString())


def test_a_tensor_of_an_operator_that_lies_in_a_file_is_refused_unread():
    """ONNX Runtime would fetch it from the folder of the entry, which no hash pins."""
    model = onnx_model()
    beside = helper.make_tensor("secret", TensorProto.FLOAT, (10,), np.zeros(10))
    beside.ClearField("float_data")
    beside.data_location = TensorProto.EXTERNAL
    beside.external_data.add(key="location", value="secret.bin")
    model.graph.node.insert(0, helper.make_node("Constant", [], ["secret"], value=beside))
    with pytest.raises(IntegrityError, match="secret in another file"):
        loaded(model.SerializeToString())


def test_dropout_that_draws_is_refused():
    model = onnx_model()
    model.graph.node.insert(
        0, helper.make_node("Dropout", ["noise", "weight", "weight"], ["dropped"])
    )
    with pytest.raises(IntegrityError, match="draws by itself"):
        loaded(model.SerializeToString())
