"""Evidence in which no two numbers are alike, and evidence on the border of what speaks.

Tables are edited below reports that stay as they were judged: a look asks tables, and which
criterion holds is asked of reports. So nothing is judged again.
"""

import json
from pathlib import Path

import evidence
import pandas as pd
import pyarrow as pa
from causes_planted import of_flow

from genpolicy.integrity.tables import read_table, write_table

FEW = 10
"""Starts of the shorter trainings."""


def edit(root: Path, path: str, change) -> None:
    """Apply `change` to one table; no lock is written, since nothing is proved."""
    file = root / "artifacts" / f"{path}.parquet"
    frame = change(read_table(file).to_pandas()).reset_index(drop=True)
    write_table(file, pa.Table.from_pandas(frame, preserve_index=False))


def number(frame):
    """A number of each row that no two conditions of a start share."""
    order = {name: place for place, name in enumerate(evidence.CONDITIONS)}
    return 7 * frame["start"] + 5 * frame["perturbation"].map(order)


def uneven(root: Path) -> None:
    """Everything differs: by start, condition, mode, method, training, term, layer and reason."""
    for path, change in (
        ("stress/rollouts", _rollouts), ("stress/splices", _splices), ("stress/counts", _discards),
        ("stress/conservation", lambda f: f.assign(generated=f["generated"] + f.index)),
        ("latency/latency", _latency), ("shadow/candidates", _candidates),
        ("shadow/holds", _holds),
        ("shadow/counts", _counts), ("measure_baselines/modes", _modes), ("reload/modes", _trained),
        ("reload/coverage", _between), ("wall_clock/invocations", _wall_clock),
    ):  # fmt: skip
        edit(root, path, change)
    file = root / "artifacts/shadow/mutants.json"
    found = [one for one in json.loads(file.read_text()) if _name(one) != "dynamic.controller_mode"]
    for place, one in enumerate(found):
        one["violations"] = one["violations"] + place
    (own,) = [one for one in found if _name(one) == "execution.stopped"]
    found += [{**own, "detected": False}, {**own, "violations": 9}]
    file.write_text(json.dumps(found))


def _name(entry) -> str:
    return f"{entry['layer']}.{entry['check']}"


def _rollouts(frame):
    """Of flow four trainings that differ, two of them short; of diffusion two that overlap."""
    flow, other = frame[of_flow(frame)], frame[frame["method"] == "diffusion"]
    few = flow[flow["start"] < FEW]
    parts = ((3, few), (2, few), (1, flow), (1, other))
    more = [part.assign(seed=seed) for seed, part in parts]
    frame = pd.concat([*more, frame], ignore_index=True)
    n = number(frame) + 11 * frame["seed"]
    mode = pd.Series("left", frame.index).mask(frame["start"] % 3 == 0, "right")
    mode = mode.mask(frame["start"] % 20 == 1, "over")
    for remainder, name in ((7, "unassigned"), (27, "none"), (47, "")):
        mode = mode.mask(frame["start"] % 50 == remainder, name)
    lost = (mode == "right") & (n % 5 > 0) | (n % 31 == 0)
    lost = lost.mask(frame["seed"] == 1, frame["start"] % 3 != 1)
    lost = lost.mask(frame["seed"] == 2, frame["start"] == 0)
    lost = lost.mask(frame["seed"] == 3, frame["start"] > 3) | (frame["start"] == 0)
    lost = lost.mask(~of_flow(frame), frame["start"] % (9 - 2 * frame["seed"]) == 4)
    p95_s = 0.1 + 0.0007 * (n % 97)
    state = frame["start"] % (80 - 3 * (n % 7))
    return frame.assign(
        mode=mode,
        success=~lost,
        outcome=(~lost).map({True: "success", False: "timeout"}),
        start_sha256=frame["perturbation"] + state.astype(str),
        action_age_p95_s=p95_s.mask(n % 13 == 0),
        action_age_max_s=(p95_s + 0.003 * (n % 11)).mask(n % 13 == 0),
        rejections=n % 4,
        invocations=20 + n % 3,
        force_peak_n=(5.0 + 0.1 * frame["start"]) * ((n % 6 > 0) & (frame["start"] % 8 > 0)),
    )


def _splices(frame):
    n = number(frame) + 3 * frame["invocation"]
    place = frame["method"].map({name: 1 + i for i, name in enumerate(evidence.COMPARED)})
    raw_m = 0.004 * (1 + n % 17) * place.fillna(30)
    more = 1.0 + 2.5 * of_flow(frame)
    rules = pd.Series(["replace", "real_time", "blend"])[n % 3].to_numpy()
    return frame.assign(raw_jump_m=raw_m, jump_m=raw_m * more, rule=rules)


def _discards(frame):
    more = [frame.assign(reason=reason) for reason in ("phase_transition", "")]
    frame = pd.concat([frame, *more], ignore_index=True)
    return frame.assign(count=frame["count"] + frame.index)


def _latency(frame):
    """Flow samples soonest and is through later; one of its terms is measured in one run."""
    n = frame["repeat"] + 3 * frame["process"] + 5 * frame["run"]
    seconds = frame["seconds"] * (1 + 0.01 * (n % 7))
    flow = of_flow(frame)
    here = flow & (frame["component"] == "network") & (frame["run"] == 1)
    return frame.assign(
        seconds=seconds + 0.02 * (flow & (frame["component"] == "project")),
        source=frame["source"].mask(here, "measured"),
    )


def _candidates(frame):
    """Two observations an episode, five reasons, every layer, moves of each size and unknown."""
    n = 4 * frame["observation"] + frame["candidate"] + 3 * of_flow(frame)
    held, right = frame["fixture"] == "held_out", frame["mode"] == "right"
    reasons = ("finite", "joint_range", "joint_jerk", "scene_collision", "contact_force")
    layers = ("representation", "kinematic", "dynamic", "geometric", "contact")
    for place, (reason, layer) in enumerate(zip(reasons, layers, strict=True)):
        refused = n % 29 < 2 if place == 0 else n % (5 + 7 * place) == 1
        refused &= held & (frame["outcome"] == "passed")
        frame = frame.assign(
            outcome=frame["outcome"].mask(refused, "failed"),
            first_reason=frame["first_reason"].mask(refused, reason),
            **{layer: frame[layer].astype(object).mask(refused, False)},
        )
        if layer != "contact":
            frame = frame.assign(contact=frame["contact"].astype(object).mask(refused, None))
    unknown = held & (n % 7 == 3) & (frame["outcome"] == "failed")
    moves_m = 0.0001 * (n % 37) + 0.02 * (right & of_flow(frame))
    return frame.assign(
        situation=[f"e{row // 2}:{row}" for row in frame["observation"]],
        mode=frame["mode"].mask(held & (n % 19 == 0), "unassigned"),
        representation=frame["representation"].mask(held & (n % 83 == 5), None),
        position_change_m=moves_m.mask(unknown).where(held, 1.0),
    )


def _holds(frame):
    event = frame["event"].mask((frame["event"] == "hold") & (frame.index % 3 == 0), "stop")
    return frame.assign(event=event, count=frame["count"] + frame.index)


def _counts(frame):
    """Chunks of each incident, those that were counted, and those that were executed, differ."""
    n = frame.index % 7
    return frame.assign(
        generated=frame["generated"] + n + 3, count=frame["count"] + n % 3,
        executed=frame["executed"] + n % 4,
    )  # fmt: skip


def _modes(frame):
    n = frame["index"]
    place = frame["method"].map({name: i for i, name in enumerate(evidence.COMPARED)}).fillna(7)
    return frame.assign(
        episode_uuid=[f"e{row % 24}" for row in n], between_modes=(n + place) % (3 + place),
        samples=16 + n % (2 + place),
    )  # fmt: skip


def _trained(frame):
    frame = pd.concat([frame, frame[of_flow(frame)].assign(seed=1)], ignore_index=True)
    n = frame["index"] + 5 * frame["seed"]
    covered = frame["modes_covered"] - (n % (4 + frame["seed"]) == 0)
    return frame.assign(episode_uuid=[f"e{row % 24}" for row in n], modes_covered=covered)


def _between(frame):
    frame = pd.concat([frame, frame.assign(seed=1, situations=31)], ignore_index=True)
    return frame.assign(between_share=0.011 * frame["nfe"] + 0.03 * frame["seed"])


def _wall_clock(frame):
    """By the wall clock flow misses every second deadline."""
    late = of_flow(frame) & (frame["clock"] == "wall") & (frame["invocation"] % 2 == 1)
    return frame.assign(
        missed=frame["missed"].mask(late, True),
        discarded_by=frame["discarded_by"].mask(late, "expired"),
        replaced=frame["replaced"].mask(late, False),
    )


def border(root: Path) -> None:
    """Every number that is held against another is that other, so that nothing speaks of it."""
    for path, change in (
        ("stress/splices", _twice), ("latency/latency", _as_long), ("shadow/candidates", _at_limit)
    ):  # fmt: skip
        edit(root, path, change)


def _twice(frame):
    """As proposed twice what simple policies do, as admitted twice of that."""
    times = 1.0 + of_flow(frame)
    return frame.assign(raw_jump_m=0.25 * times, jump_m=0.25 * times * times)


def _as_long(frame):
    """What flow gains in sampling it loses in projection; each number is a power of two."""
    sooner = (frame["component"] == "sample") & of_flow(frame)
    sooner |= (frame["component"] == "project") & ~of_flow(frame)
    slower = frame["component"].isin(["sample", "project"]) & ~sooner
    return frame.assign(seconds=(2.0**-8 + 2.0**-9 * sooner).mask(slower, 2.0**-6))


def _at_limit(frame):
    """Mode right is moved by as much as may be, mode left by less."""
    right = of_flow(frame) & (frame["mode"] == "right")
    return frame.assign(position_change_m=(0.001 + 0.0 * frame["observation"]).mask(right, 0.02))
