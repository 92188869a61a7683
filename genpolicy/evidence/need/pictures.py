"""A picture of a task's cell for its reports; the task draws it, the same bytes every time."""

import io
from typing import Any

from matplotlib.image import imsave

from genpolicy.seeds import stream
from genpolicy.tasks.api import load_task

WIDTH_PX, HEIGHT_PX = 640, 440
SEED = 0


def scene_png(task_name: str) -> bytes:
    """The cell of a registered task at one start, as a PNG without metadata.

    The start is drawn from the task's own distribution under a fixed seed.

    Args:
        task_name: Registered name.

    Returns:
        A PNG of 640 x 440 pixels.

    Raises:
        ConfigError: No such task.
    """
    task = load_task(task_name)
    start = task.sample_start(stream(SEED, "scene_picture"))
    pixels = task.picture(start, width_px=WIDTH_PX, height_px=HEIGHT_PX)
    nothing: Any = {"Software": None}
    sink = io.BytesIO()
    imsave(sink, pixels, format="png", metadata=nothing)
    return sink.getvalue()
