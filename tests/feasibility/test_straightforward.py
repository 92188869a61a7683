"""The plain reference of the benchmark: its meshes, its answers, and that nothing is guessed."""

import numpy as np
import pytest

from benchmarks.feasibility.__main__ import between, chunks, context, main, proposal
from benchmarks.feasibility.plain import plain_cell
from benchmarks.feasibility.straightforward import SUB_SAMPLES, Straightforward, mesh_of
from genpolicy.feasibility.admission import Admitted


@pytest.fixture(scope="module")
def plain(cell):
    return plain_cell(cell)


def test_a_mesh_is_closed_turned_outwards_and_as_large_as_its_shape(plain):
    kinds = set()
    for shape in (*plain.collision.shapes.robot, *plain.collision.shapes.scene):
        vertices, triangles = mesh_of(shape)
        x, y, z = shape.half_size_m
        a, b, c = (vertices[triangles[:, i]] for i in range(3))
        volume = abs(float(np.sum(np.einsum("ni,ni->n", a, np.cross(b, c))))) / 6
        ball = 4 / 3 * np.pi * x**3
        true = {
            "box": 8 * x * y * z, "cylinder": 2 * np.pi * x**2 * z, "sphere": ball,
            "capsule": ball + 2 * np.pi * x**2 * z,
        }[shape.kind]  # fmt: skip
        assert volume == pytest.approx(true, rel=0.03) and volume <= true * (1 + 1e-9)
        kinds.add(shape.kind)
    assert len(kinds) > 1


def test_it_says_what_the_layers_say_where_nothing_is_close(checker, plain, kit):
    """One chunk around the post and one through it, and each sub-sample was asked."""
    ctx = context(checker)
    way = Straightforward(plain.kinematics, plain.collision, ctx.scene)
    width_m = plain.collision.shapes.held_half_width_m
    passed = []
    for number, actions in enumerate((kit.detour(1), kit.line(kit.START, (0.50, 0.0, 0.15)))):
        passed.append(way.passes(actions, q_cmd_rad=ctx.q_cmd, opening_m=width_m))
        admitted = isinstance(checker.admit(proposal(actions, number), context=ctx), Admitted)
        assert passed[-1] == admitted
    assert passed == [True, False]
    assert way.asked.solved == 2 * kit.K
    assert way.asked.configurations == 2 * kit.K * (1 + SUB_SAMPLES)


def test_sub_samples_lie_on_the_way_and_are_as_many_as_are_told():
    q = np.arange(2 * 3 * 7, dtype=float).reshape(2, 3, 7)
    found = between(q, np.zeros(7))
    assert found.shape == (2 * 3 * SUB_SAMPLES, 7)
    assert np.allclose(found[:SUB_SAMPLES], q[0, 0] * np.arange(1, 6)[:, None] / 6)
    assert np.allclose(found[SUB_SAMPLES], q[0, 0] + (q[0, 1] - q[0, 0]) / 6)


def test_the_benchmark_runs_and_says_how_much_was_asked(capsys):
    main(["--invocations", "1", "--candidates", "2"])
    said = capsys.readouterr().out
    assert f"32 poses solved and {32 * (1 + SUB_SAMPLES)} configurations asked" in said
    assert f"({32 * SUB_SAMPLES} configurations)" in said
    assert "(from the line above)" not in said
    assert len(chunks(np.random.default_rng(0), 3)) == 3
