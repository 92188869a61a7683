"""Who made what a session executed, and from which start: held against checkpoints and the plan.

A journal proves what was done with the chunks of some policy. That it was the policy of this
report, and that it began where the plan begins, is asked here.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from gates.rederive_brought import brought_policy
from gates.rederive_distilled import identity
from gates.rederive_planner import planner_maker
from gates.rederive_shadow import TaskSection
from gates.report import Gate
from gates.stated import mapping, refuse, root_seed, section, training_seed
from genpolicy.candidates.joining import REPLACE, JoiningSettings
from genpolicy.candidates.judged import BASELINES, GENERATORS
from genpolicy.contract.planner import PLANNER
from genpolicy.evidence.stress.matched import matched_starts
from genpolicy.evidence.stress.settings import StressSettings
from genpolicy.integrity.documents import canonical_json, read_json
from genpolicy.integrity.hashing import sha256_bytes
from genpolicy.tasks.api import WorldSettings, load_task
from genpolicy.verification.begun import Begun, Maker, begun_sessions
from genpolicy.verification.joined import LABEL
from genpolicy.verification.journal_source import readable

Array = NDArray[np.float64]
REPLACING = JoiningSettings()
TOLERANCE = 1e-6
"""Of a pose, m or without unit: another processor rounds, another start is centimetres away."""
ARM_RAD = 1e-4
"""Of a joint at the start: journals have six decimals, and where the arm stands was solved for."""


def rederive_sessions(
    root: Path,
    gate: Gate,
    params: Mapping[str, Any],
    journals: Sequence[Path],
    *,
    recorded: bool = False,
) -> None:
    """Hold the maker of every session against the trained policies, and its start against the plan.

    Gate C changes the active maker within a session on purpose; there the first one counts. What
    Gate E reads began where a search asked for it, which is asked where the search is done again.

    Args:
        root: Root of the workspace.
        gate: Whose evidence it is.
        params: `params.yaml`.
        journals: Their files.
        recorded: Whether they replay recordings, where nothing joins and no start was planned.

    Raises:
        RefusedError: A session was made by another policy, or began elsewhere.
        ConfigError: A section of `params.yaml` cannot be read.
        IntegrityError: A file is missing or no regular file.
        BadInputError: A file cannot be read.
    """
    seed = training_seed(params)
    simulated = gate != "C" and not recorded
    joining = section(params, "stress", StressSettings).joining if simulated else REPLACING

    @cache
    def maker(method: str) -> Maker | None:
        if method == PLANNER:
            return planner_maker(params, joining.named(method))
        other = brought_policy(root, params, method)
        if other is not None:
            return other.sha256, joining.named(method).sampler_hash(other.sampler_sha256)
        return _maker(root, method, seed, joining.named(method))

    planned = _Planned(params) if simulated and gate == "D" else None
    for path in journals:
        with readable(f"{path.parent.name}/{path.name}"):
            sessions = begun_sessions(path)
            for name, session in sessions.items():
                place = f"{path.name}: {name}"
                own = maker(session.labels["method"])
                others = set(session.makers[: 1 if gate == "C" else None]) - {own}
                if own is None or others or not session.makers:
                    made = ", ".join(sorted(checkpoint for checkpoint, _ in others)) or "nobody"
                    refuse(gate, f"{place}: made by", made, "the policy of that name, as trained")
                _joined(gate, place, session, joining)
                if planned is not None:
                    _began(gate, place, session, planned)


def _maker(root: Path, method: str, seed: object, joining: JoiningSettings) -> Maker | None:
    """Weights and sampler of a trained policy; None where there is none of the name."""
    folder = checkpoint_of(root, method, seed)
    if folder is None:
        return None
    sampler = mapping(mapping(read_json(folder / "config.json")).get("sampler"))
    return identity(folder), joining.sampler_hash(sha256_bytes(canonical_json(sampler)))


def checkpoint_of(root: Path, method: str, seed: object) -> Path | None:
    """Folder of a trained policy; None where there is none of the name.

    A method may be trained as a baseline for Gate A and stand as a candidate: then the candidate
    is who was run, since none may stand in one comparison twice (`candidates.judged.compared`).
    """
    for stage in (GENERATORS, BASELINES):
        folder = root / "artifacts" / stage / method / f"seed_{seed}"
        if (folder / "config.json").is_file():
            return folder
    return None


def _joined(gate: Gate, place: str, session: Begun, joining: JoiningSettings) -> None:
    """By which rule the checker held its chunks against their record is what the session says."""
    planned = joining.named(session.labels["method"]).rule
    said = session.labels.get(LABEL, REPLACE)
    if said != planned:
        refuse(gate, f"{place}: its chunks join by", said, f"{planned}, as planned")


@dataclass(frozen=True)
class _Start:
    """A planned start as it is first seen: poses of the scene by body, and joints, rad."""

    scene: Mapping[str, Array]
    q_rad: Array


class _Planned:
    """The planned starts, each made when a session of it is looked at: a world settles first."""

    def __init__(self, params: Mapping[str, Any]) -> None:
        self._task = load_task(section(params, "task", TaskSection).name)
        count = section(params, "stress", StressSettings).starts
        self._starts = matched_starts(self._task, root_seed=root_seed(params), count=count)
        self._seen: dict[int, _Start] = {}

    def __len__(self) -> int:
        return len(self._starts)

    def __getitem__(self, number: int) -> _Start:
        """A planned start as it is first seen."""
        if number not in self._seen:
            settings = WorldSettings(calibration_epoch=self._task.calibration_epochs[-1])
            world = self._task.make_world(self._starts[number], settings=settings)
            seen = self._task.scene_poses(world.observe())
            scene = {body: np.concatenate(pose) for body, pose in seen.items()}
            self._seen[number] = _Start(scene, np.array(world.q_meas))
        return self._seen[number]


def _began(gate: Gate, place: str, session: Begun, planned: _Planned) -> None:
    number = int(session.labels["start"])
    seen = session.bodies or {}
    if not 0 <= number < len(planned):
        refuse(gate, f"{place}: start", str(number), f"one of the {len(planned)} that are planned")
    start, q_rad = planned[number], session.q_rad
    expected, arm = start.scene, start.q_rad
    if set(seen) != set(expected) or not all(
        np.allclose(seen[body], expected[body], rtol=0.0, atol=TOLERANCE) for body in expected
    ):
        refuse(gate, f"{place}: first seen", _said(seen), f"{_said(expected)}, as planned")
    if (
        q_rad is None
        or q_rad.shape != arm.shape
        or not np.allclose(q_rad, arm, rtol=0.0, atol=ARM_RAD)
    ):
        refuse(gate, f"{place}: first measured", _joints(q_rad), f"{_joints(arm)}, as planned")


def _joints(q_rad: Array | None) -> str:
    return "nothing" if q_rad is None else f"joints at {np.round(q_rad, 4).tolist()} rad"


def _said(bodies: Mapping[str, Any]) -> str:
    """Where bodies are, m."""
    places = (f"{body} {np.round(pose[:3], 4).tolist()}" for body, pose in sorted(bodies.items()))
    return ", ".join(places) or "nothing"
