"""The sensors: from what happened to the rows of a data set, with their noise, delays and faults.

Streams have their own clock. A stream whose stamps run ahead by d delivers at tick t what was true
at t - d, and seems to arrive d too early. Every cell has small errors of clock and calibration,
well below what matters; a planted fault comes on top.
"""

from dataclasses import dataclass

import numpy as np

from benchmarks.audit import insertion, planar
from benchmarks.audit.defects import Faults, glue, repeat, spoil_rows
from benchmarks.audit.plan import OBJECTS, OPERATORS, Array, Plan, Roster, draw_roster
from benchmarks.audit.truth import Truth
from genpolicy.audit.data import AuditInput, Episodes
from genpolicy.seeds import stream

TASKS = {"planar": planar, "insertion": insertion}
# What a healthy cell leaves: clocks to a few milliseconds, cameras to half a millimetre.
CLOCK_ERROR_S = 0.002
CAMERA_ERROR_M = 0.0004
POSITION_NOISE_M = 0.0002
CAMERA_NOISE_M = 0.0004
DELAY_S = {"robot": (0.001, 0.003), "camera": (0.020, 0.060)}
ROBOT_PERIOD_S = 0.01
EPISODE_SPACING_S = 60.0
# How often a stratum, or the receive times, were recorded in data sets where they do not matter.
RECORDED_SHARE = 0.7


@dataclass(frozen=True)
class Labelled:
    """A data set for the audit, and what its replay would say.

    Attributes:
        data: Rows and episodes.
        outcomes: True outcome of each episode, by identifier.
    """

    data: AuditInput
    outcomes: dict[str, str]


def record(task: str, plan: Plan) -> Labelled:
    """Demonstrate and record the data set of a plan."""
    world = TASKS[task]
    roster, cell = draw_roster(plan, world.GOAL_HALF_WIDTH_M), world.make_cell(plan)
    n = len(roster.mode)
    truths = [world.demonstrate(plan, roster, number, cell) for number in range(n)]
    faults = Faults(plan, roster, world.PERIOD_S)
    episodes = [_observe(world, plan, roster, k, truths[k], faults) for k in range(n)]
    rng = stream(plan.seed, "labels")
    truth = np.array(["success" if item.success else "failure" for item in truths])
    wrong = rng.random(n) < plan.wrong_labels
    if plan.wrong_mode_only:
        wrong &= roster.mode == len(plan.shares) - 1
    label = np.where(wrong, np.where(truth == "success", "failure", "success"), truth)
    table = _table(plan, roster, label)
    episodes, table, truth = repeat(plan, episodes, table, truth)
    episodes, table, truth = glue(plan, episodes, table, truth)
    data = _assemble(world, plan, episodes, table, task)
    return Labelled(data, dict(zip(table["uuid"].tolist(), truth.tolist(), strict=True)))


def _observe(
    world, plan: Plan, roster: Roster, number: int, truth: Truth, faults: Faults
) -> dict[str, Array]:
    """Columns of one episode as they were recorded."""
    rng = stream(plan.seed, "sensors", number)
    epoch = int(roster.epoch[number])
    ticks = world.PERIOD_S * np.arange(len(truth.command))
    healthy = stream(plan.seed, "cell", "epoch", epoch)
    share = plan.by_chance
    clock = {name: share * CLOCK_ERROR_S * healthy.uniform(-1.0, 1.0) for name in DELAY_S}
    shift = share * CAMERA_ERROR_M * healthy.normal(size=2)
    ahead = {name: clock[name] + faults.clock(name, number, len(ticks)) for name in DELAY_S}
    sampled = ticks - share * rng.uniform(0.0, ROBOT_PERIOD_S, len(ticks))
    position = truth.position(sampled - ahead["robot"])
    position = position + share * POSITION_NOISE_M * rng.normal(size=position.shape)
    scene = np.tile(truth.scene, (len(ticks), 1))
    if truth.moved is not None:
        scene[:, :2] += truth.moved
    scene[:, :2] += shift
    scene[:, world.SCENE_LENGTHS] += (
        share * CAMERA_NOISE_M * rng.normal(size=(len(ticks), len(world.SCENE_LENGTHS)))
    )
    columns = {
        "position": position,
        "scene": scene,
        "lamp": truth.lamp[:, None],
        "command": truth.command,
        "time": ticks + EPISODE_SPACING_S * number,
        "phase": np.array(truth.phase),
        **truth.other,
    }
    for name, (low, high) in DELAY_S.items():
        columns[f"delay_{name}"] = rng.uniform(low, high, len(ticks)) - ahead[name]
        columns[f"stamp_{name}"] = columns["time"] + ahead[name]
    return spoil_rows(plan, columns, faults, number)


def _table(plan: Plan, roster: Roster, label) -> dict[str, np.ndarray]:
    n = len(label)
    return {
        "uuid": np.array([f"ep{number:05d}" for number in range(n)]),
        "split": roster.split,
        "operator": roster.operator,
        "object": roster.object,
        "calibration_epoch": np.char.add("epoch_", (roster.epoch + 1).astype(str)),
        "outcome": label,
        "is_recovery": roster.recovery,
        "order": np.arange(n, dtype=np.float64),
    }


def _assemble(world, plan, episodes, table, task) -> AuditInput:
    rng = stream(plan.seed, "recorded")
    for name in ("operator", "object"):
        known = rng.random() < RECORDED_SHARE or plan.exact
        if not known and plan.decided_by != name:
            table[name] = np.full(len(table["uuid"]), "")
    needs_delay = any(d.kind in ("camera_clock", "drop_camera") for d in plan.defects)
    delays = (bool(rng.random() < RECORDED_SHARE) and not plan.exact) or needs_delay
    joined = {name: np.concatenate([item[name] for item in episodes]) for name in episodes[0]}
    lengths = [len(item["time"]) for item in episodes]
    layout = world.layout(joined)
    if plan.exact:
        layout.pop("streams")  # a scene without noise stands still
    assert set(np.unique(table["object"])) <= {"", *OBJECTS}
    assert set(np.unique(table["operator"])) <= {"", *OPERATORS}
    return AuditInput(
        **layout,
        phase=joined["phase"],
        episode=np.repeat(np.arange(len(episodes)), lengths),
        index=np.concatenate([np.arange(length) for length in lengths]),
        event_time_s=joined["time"],
        episodes=Episodes(**table),
        period_s=world.PERIOD_S,
        delay_s={name: joined[f"delay_{name}"] for name in DELAY_S} if delays else {},
        stream_time_s={name: joined[f"stamp_{name}"] for name in DELAY_S} if delays else {},
        position_stream="robot",
        phase_observed=plan.phase_observed,
    )
