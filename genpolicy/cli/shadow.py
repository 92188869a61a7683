"""`genpolicy shadow`: a recorded episode on the clock of the wall, in two processes, to the stub.

Nothing moves. A person at the terminal can stop the run at any time, and the policy cannot undo
that.
"""

import select
import sys
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from subprocess import TimeoutExpired
from typing import Any, TextIO

from genpolicy.candidates.judged import GENERATORS, JudgedPolicy, trained
from genpolicy.contract.settings import parse_settings
from genpolicy.data.dataset import Dataset, load_dataset
from genpolicy.errors import ConfigError
from genpolicy.evidence.admission_context import make_checker
from genpolicy.evidence.documents.shadow import Checked
from genpolicy.evidence.shadow.tables import checker_document
from genpolicy.integrity.documents import read_yaml
from genpolicy.policies.matched_training import PolicySettings
from genpolicy.tasks.api import load_task
from genpolicy.wall_clock.limits import WallClockLimits, read_limits
from genpolicy.wall_clock.messages import Order
from genpolicy.wall_clock.recorded import replay_of
from genpolicy.wall_clock.request import WallClockRequest
from genpolicy.wall_clock.run import Running, loading, start
from genpolicy.wall_clock.streamed import JOURNAL

LOOK_S = 0.1
HELD_OUT = "test"
HELP = "Type `stop` for an E-stop, `reset NAME` to clear a stop, `end` to end."


@dataclass(frozen=True)
class ShadowOptions:
    """What the user asked for.

    Attributes:
        root: Workspace with pinned limits and artifacts.
        out: Folder of the run.
        method: Whose checkpoint.
        episode: Which recorded episode; empty for the first held-out one.
    """

    root: Path
    out: Path
    method: str
    episode: str = ""


def run_shadow(options: ShadowOptions, admitted: Sequence[str]) -> int:
    """Replay an episode; print what became of it. Returns the exit code.

    Args:
        options: What the user asked for.
        admitted: Methods that the gate below admits.

    Raises:
        ConfigError: The method was not admitted, its horizons are not those of the limits, or
            limits and fixtures are not as pinned.
        BadInputError: A file is missing or malformed.
        GenpolicyError: The supervisor's process died.
    """
    limits = read_limits(options.root)
    policy = _policy(options, admitted, limits)
    data = load_dataset(options.root / "artifacts" / "ingest")
    loaded = policy.load()
    request = WallClockRequest(
        root=str(options.root.resolve()),
        method=policy.name,
        checkpoint=loaded.checkpoint_hash,
        sampler=loaded.sampler_config_hash,
        replay=replay_of(data, load_task(limits.task), options.episode or _held_out(data)),
    )
    del loaded
    command = loading(policy.folder, policy.sha256, device=policy.device)
    running = start(options.out, request, command)
    print(f"Replaying {len(request.replay)} rows. {HELP}")
    outcome = attend(running, sys.stdin)
    return _tell(outcome, _checked(options.out, limits))


def attend(running: Running, terminal: TextIO) -> dict[str, Any]:
    """Pass on what a person types until the run is over; an interrupt is an E-stop.

    Returns:
        The outcome.
    """
    listening = True
    while True:
        try:
            return running.wait(0.0 if listening else LOOK_S)
        except TimeoutExpired:
            pass
        except KeyboardInterrupt:
            running.say(Order.EMERGENCY_STOP, "interrupt at the terminal")
            running.say(Order.END)
            continue
        try:
            if listening and select.select([terminal], [], [], LOOK_S)[0]:
                line = terminal.readline()
                listening = bool(line)
                _obey(running, line.split())
        except KeyboardInterrupt:
            running.say(Order.EMERGENCY_STOP, "interrupt at the terminal")
            running.say(Order.END)


def _obey(running: Running, words: list[str]) -> None:
    match words:
        case ["stop", *why]:
            running.say(Order.EMERGENCY_STOP, " ".join(["at the terminal", *why]))
        case ["reset", *name] if name:
            running.say(Order.RESET, " ".join(name))
        case ["end"]:
            running.say(Order.END)
        case [_, *_]:
            print(HELP, file=sys.stderr)


def _policy(
    options: ShadowOptions, admitted: Sequence[str], limits: WallClockLimits
) -> JudgedPolicy:
    if options.method not in admitted:
        raise ConfigError(
            where="--method",
            found=repr(options.method),
            expected=f"one that gate B admits: {', '.join(admitted)}",
            action="Name one of them.",
        )
    params = read_yaml(options.root / "params.yaml")
    if options.method in params.get("candidates", {}):
        raise ConfigError(
            where="--method",
            found=f"{options.method}, a policy that was brought",
            expected="one that is trained here: it runs in the process that this command starts",
            action="See its run by the wall clock in the stage `wall_clock`, or name another one.",
        )
    section = params.get("policy", {})
    seed = parse_settings(PolicySettings, section, where="params.yaml: policy").seeds[0]
    folder = options.root / "artifacts" / GENERATORS
    device = str(params.get("compute", {}).get("device"))
    policy = trained(folder, [options.method], seeds=[seed], device=device)[0]
    horizons = policy.load().horizons
    if horizons != limits.horizons:
        raise ConfigError(
            where=f"the horizons of {options.method}",
            found=str(horizons),
            expected=f"{limits.horizons}, those of the limits",
            action="Train with these horizons, or review the limits and pin them.",
        )
    return policy


def _held_out(data: Dataset) -> str:
    """The first held-out episode that ended well; the first held-out one if none did."""
    held_out = data.split(HELD_OUT).episodes
    good = held_out[held_out["outcome"] == "success"]
    return str((good if len(good) else held_out)["episode_uuid"].iloc[0])


def _checked(out: Path, limits: WallClockLimits) -> Checked:
    period_s = limits.horizons.action_period_s
    checker = make_checker(load_task(limits.task), limits.feasibility, action_period_s=period_s)
    return checker_document([out / JOURNAL], cell=limits.cell, robot=checker.cell)


def _tell(outcome: dict[str, Any], checked: Checked) -> int:
    chunks = outcome["chunks"]
    print(
        f"{outcome['ticks']} ticks, {outcome['missed']} missed; of {chunks['generated']} chunks "
        f"{chunks['executed']} reached the stub, {outcome['accepted']} actions; ended in "
        f"{outcome['state']}"
    )
    for name, counts in (("discarded", chunks["discarded"]),
                         ("dropped", outcome["dropped"])):  # fmt: skip
        if counts:
            print(f"{name}: " + ", ".join(f"{why} {count}" for why, count in counts.items()))
    print(f"independent checker: {len(checked.violations)} broken rules")
    for violation in checked.violations:
        print(f"  {violation.rule}: {violation.text}")
    return 1 if checked.violations else 0
