"""Messages: shaped as the viewer knows them, whole at every time, the same bytes everywhere."""

import jsonschema
import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from genpolicy.replay import messages as m

GREY = (0.5, 0.5, 0.5, 1.0)


def checked(document, name=m.SCENE_SCHEMA_NAME):
    jsonschema.validate(document, m.SCHEMAS[name], cls=jsonschema.Draft202012Validator)
    return document


def full():
    """An entity with every kind of primitive that is written."""
    place, turned = np.array([0.1, -0.2, 0.3]), Rotation.from_euler("xyz", [0.1, 0.2, 0.3])
    size = np.array([0.01, 0.02, 0.03])
    return m.entity(
        "x", 1_500_000_000, facts=[("body", "post")],
        cubes=[m.solid(place, turned.as_matrix(), size, GREY)],
        spheres=m.dots(place[None], GREY, diameter_m=0.01),
        cylinders=[m.cylinder(place, turned.as_matrix(), size, GREY)],
        lines=[m.line(np.stack([place, size]), GREY), m.line(np.zeros((0, 3)), GREY, pairs=True)],
        texts=[m.letters(place, "said", GREY)],
    )  # fmt: skip


@pytest.mark.parametrize("name", sorted(m.SCHEMAS))
def test_every_schema_is_one_and_bears_its_name(name):
    jsonschema.Draft202012Validator.check_schema(m.SCHEMAS[name])
    assert m.SCHEMAS[name]["title"] == name


def test_an_update_has_the_fields_of_its_schema():
    checked(m.scene_update(7, [full()]))
    checked(m.transform(7, "tcp", np.zeros(3), np.eye(3)), m.TRANSFORM_SCHEMA_NAME)
    checked(m.log(7, m.INFO, "said", name="hold", source=("s", 3)), m.LOG_SCHEMA_NAME)


def test_names_are_those_that_the_viewer_knows():
    """Golden: fields of SceneEntity and of its primitives, from Foxglove's documentation."""
    found = full()
    assert set(found) == {
        "timestamp", "frame_id", "id", "lifetime", "frame_locked", "metadata", "arrows", "cubes",
        "spheres", "cylinders", "lines", "triangles", "texts", "models",
    }  # fmt: skip
    assert set(found["cubes"][0]) == set(found["spheres"][0]) == {"pose", "size", "color"}
    assert set(found["cylinders"][0]) - {"pose", "size", "color"} == {"bottom_scale", "top_scale"}
    assert set(found["lines"][0]) == {
        "type", "pose", "thickness", "scale_invariant", "points", "color", "colors", "indices",
    }  # fmt: skip
    assert set(found["texts"][0]) == {
        "pose", "billboard", "font_size", "scale_invariant", "color", "text",
    }  # fmt: skip
    assert found["timestamp"] == {"sec": 1, "nsec": 500_000_000}
    assert found["frame_id"] == "robot_base"


@pytest.mark.parametrize(
    "spoil",
    [
        lambda e: e["timestamp"].update(nsec=1_000_000_000),
        lambda e: e["cubes"][0]["color"].update(a=1.5),
        lambda e: e["cubes"][0]["size"].update(x=None),
        lambda e: e["lines"][0].update(type=3),
        lambda e: e["texts"][0].pop("text"),
        lambda e: e.pop("cylinders"),
        lambda e: e.update(id=3),
    ],
)
def test_the_schema_refuses_what_is_none(spoil):
    found = full()
    spoil(found)
    with pytest.raises(jsonschema.ValidationError):
        checked(m.scene_update(7, [found]))


def test_an_update_deletes_what_stood_before():
    [deletion] = m.scene_update(7, [])["deletions"]
    assert deletion == {"timestamp": {"sec": 0, "nsec": 7}, "type": 1, "id": ""}


def test_a_rotation_there_and_back():
    turned = Rotation.random(50, random_state=3)
    for matrix in turned.as_matrix():
        q = m.quaternion(matrix)
        assert q["w"] >= 0
        again = Rotation.from_quat([q[name] for name in "xyzw"]).as_matrix()
        np.testing.assert_allclose(again, matrix, atol=1e-5)


def test_the_last_bits_of_a_processor_are_not_written():
    assert m.vector(np.array([0.1 + 1e-12, -1e-12, 3.0])) == {"x": 0.1, "y": 0.0, "z": 3.0}
    assert str(m.vector(np.array([0.0, -1e-12, 0.0]))["y"]) == "0.0"
