"""A picture of a task's cell for its reports: ray cast, no display, the same bytes every time."""

import io
from typing import Any

import mujoco
from matplotlib.image import imsave

from genpolicy.seeds import stream
from genpolicy.tasks.api import Task, WorldSettings, load_task
from genpolicy.tasks.tabletop_insertion.picture import draw

WIDTH_PX, HEIGHT_PX = 640, 440
SEED = 0


def scene_png(task_name: str) -> bytes:
    """The cell of a registered task at one start, as a PNG without metadata.

    The start is drawn from the task's own distribution under a fixed seed. A task whose world
    shows no MuJoCo state is drawn from its scene file at rest.

    Args:
        task_name: Registered name.

    Returns:
        A PNG of 640 x 440 pixels.

    Raises:
        ConfigError: No such task.
    """
    model, data = _state(load_task(task_name))
    pixels = draw(model, data, width=WIDTH_PX, height=HEIGHT_PX)
    nothing: Any = {"Software": None}
    sink = io.BytesIO()
    imsave(sink, pixels, format="png", metadata=nothing)
    return sink.getvalue()


def _state(task: Task) -> tuple[mujoco.MjModel, mujoco.MjData]:
    start = task.sample_start(stream(SEED, "scene_picture"))
    world: Any = task.make_world(start, settings=WorldSettings(task.calibration_epochs[0]))
    model, data = getattr(world, "model", None), getattr(world, "data", None)
    if isinstance(model, mujoco.MjModel) and isinstance(data, mujoco.MjData):
        return model, data
    model = mujoco.MjModel.from_xml_path(str(task.scene_path))
    data = mujoco.MjData(model)
    mujoco.mj_forward(model, data)
    return model, data
