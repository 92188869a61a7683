"""What a real `dvc repro`, and a reviewer's `genpolicy verify report`, say of a workspace.

A stop is a gate, and why: the criterion that is not met, or a refusal in the words of the stage
that refused. Nothing here calls a gate's functions: only what it wrote and printed is read.
"""

import json
import re
import subprocess
import sys
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Literal

from flows.reproduce import reproduce, stage_environment

GATES = "ABCDE"
GATE_OF_STAGE = {
    **dict.fromkeys(
        ("task", "record", "ingest", "audit", "train_baselines", "measure_baselines",
         "train_factors", "measure_factors", "gate_a"), "A"),
    **dict.fromkeys(("candidates", "train_generators", "reload", "latency", "gate_b"), "B"),
    **dict.fromkeys(("shadow", "gate_c"), "C"),
    **dict.fromkeys(("wall_clock", "stress", "monitors", "gate_d"), "D"),
    **dict.fromkeys(("failure_search", "card", "gate_e"), "E"),
}  # fmt: skip
LAST = {"small": "E", "brought": "A", "signed": "E"}
"""The last gate of each base; what stands above it is not looked at."""
TARGETS = {"small": (), "brought": ("gate_a",), "signed": ("gate_e",)}
PROOF = ("verify", "report")
_PROOF = {"signed": ("gates", "check", "--through", "E")}
"""Synthetic evidence has no journals from which it could be derived again."""
REFUSES = re.compile(r"Gate (?P<gate>[A-E]) refuses: (?P<what>.*)")
OUTPUT = re.compile(r"^artifacts/(?P<folder>\w+)/")
"""Begins the refusal of a file in a stage's folder, which comes before any stage."""
REFUSED_CRITERION = re.compile(r"^[a-z_0-9]+(\([a-z_0-9]+\))? is ")
WAITING = "PENDING_REVIEW"
GOOD = {"small": ("PASS", WAITING), "brought": ("PASS", WAITING), "signed": ("PASS",)}
"""What stops nothing: where everybody has signed, a gate that waits for people lets nobody by."""

Count = Literal["right", "elsewhere", "not at all"]


@dataclass(frozen=True)
class Stop:
    """One reason for which a workspace is stopped.

    Attributes:
        gate: Letter.
        reason: Id of a criterion, or `refusal`.
        detail: Measured against the limit, or the sentence of the refusal.
        candidate: Method it speaks of; empty for the whole gate.
    """

    gate: str
    reason: str
    detail: str
    candidate: str = ""


@dataclass(frozen=True)
class Seen:
    """All that was seen of a workspace.

    Attributes:
        stops: By gate, refusals first within one.
        code: Exit code of `dvc repro`, as flows.reproduce reads it.
        sentence: What it said at its end.
        ran: Stages that ran.
        seconds: Wall time.
    """

    stops: tuple[Stop, ...]
    code: int = 0
    sentence: str = ""
    ran: tuple[str, ...] = ()
    seconds: float = 0.0


@dataclass(frozen=True)
class Expected:
    """Where a wrong has to be stopped, and why.

    Attributes:
        gate: Letter.
        criteria: Ids of criteria, any of which names the wrong.
        refusal: Pattern of the refusal that names it; empty where a criterion must. Evidence that a
            criterion says it cannot be measured from is refused too, in the words of its gate.
        candidate: Method whose verdict it must be; empty for any.
        said: Pattern of what the criterion must say beside its number; empty for anything.
    """

    gate: str
    criteria: tuple[str, ...] = ()
    refusal: str = ""
    candidate: str = ""
    said: str = ""

    def names(self, stop: Stop) -> bool:
        """Whether a stop gives this reason, at whatever gate."""
        if self.candidate and stop.candidate and stop.candidate != self.candidate:
            return False
        if stop.reason in self.criteria:
            return not self.said or bool(re.search(self.said, stop.detail))
        said = stop.detail if stop.reason == "refusal" else _unmeasured(stop.detail)
        return bool(self.refusal and said and re.search(self.refusal, said))


def _unmeasured(detail: str) -> str:
    """Why a criterion says that nothing can be measured; empty where it measured something."""
    return detail.partition("(not measured: ")[2]


@dataclass
class Runs:
    """Names of the stages that ran, from what DVC prints."""

    lines: list[str] = field(default_factory=list)

    def echo(self, line: str) -> None:
        """One line of output."""
        self.lines.append(line)

    @property
    def stages(self) -> tuple[str, ...]:
        """In their order."""
        return tuple(x.split("'")[1] for x in self.lines if x.startswith("Running stage '"))


def settled(workspace: Path, *stages: str) -> Path:
    """Bring a base up to date; it has to end well, or nothing can be learnt on it.

    Raises:
        RuntimeError: It did not.
    """
    runs = Runs()
    end = reproduce(workspace, stages=stages, single_item=_single(workspace), echo=runs.echo)
    if end.code != 0:
        raise RuntimeError(f"the honest base {workspace} is stopped: {end.sentence}")
    return workspace


def run(workspace: Path, base: str) -> Seen:
    """`dvc repro`, then the reports, then `genpolicy verify report` where the first ended well.

    Raises:
        RuntimeError: The machinery broke (exit 1): no verdict on anything.
    """
    runs = Runs()
    end = reproduce(workspace, stages=TARGETS[base], single_item=_single(workspace), echo=runs.echo)
    if end.infrastructure or (end.code == 1 and not end.stage):
        raise RuntimeError(f"the machine failed, not the ladder: {end.sentence}")
    stops: list[Stop] = []
    if end.code != 0 and not end.verdict:  # the report of a gate that judged says it better
        refused = refused_by(end.stage, _said(end.sentence, runs.lines))
        stops = [refused] if refused else []
    seen = look(workspace, base)
    found = {(s.gate, s.reason, s.candidate): s for s in (*stops, *seen.stops)}
    if not found:
        found = {(s.gate, s.reason, s.candidate): s for s in verified(workspace, base)}
    ordered = sorted(found.values(), key=lambda s: (s.gate, s.reason != "refusal"))
    return Seen(tuple(ordered), end.code, end.sentence, runs.stages, round(end.duration_s, 1))


def look(workspace: Path, base: str) -> Seen:
    """The criteria that are not met, by the reports as they lie there."""
    stops, good = [], GOOD[base]
    for gate in GATES[: GATES.index(LAST[base]) + 1]:
        path = workspace / "reports" / f"gate_{gate.lower()}.json"
        if not path.is_file():
            continue
        try:
            report = json.loads(path.read_text())
            criteria, verdict = report["criteria"], report["verdict"]
        except (ValueError, KeyError, TypeError):
            stops.append(Stop(gate, "refusal", f"{path.name} is no report"))
            continue
        unmet = [c for c in criteria if c["verdict"] not in good]
        stops += [
            Stop(gate, c["id"], _numbers(c), c["candidate"] or "")
            for c in unmet
            if not (gate == "A" and verdict == "PASS" and c["id"] == "recovery_benefit")
        ]
        if verdict not in good and not unmet:
            stops.append(Stop(gate, "refusal", f"{verdict}: {'; '.join(report['caveats'])}"))
        if verdict != "PASS":
            break  # what stands above was judged before
    return Seen(tuple(stops))


def verified(workspace: Path, base: str) -> list[Stop]:
    """What `genpolicy verify report` refuses; what a reviewer or CI would run."""
    done = subprocess.run(
        [sys.executable, "-m", "genpolicy", *_PROOF.get(base, PROOF), "--json"],
        cwd=workspace,
        env=stage_environment(workspace),
        capture_output=True,
        text=True,
        check=False,
    )
    if done.returncode not in (0, 2, 3):
        raise RuntimeError(f"the proof broke: {done.stderr[-400:]}")
    try:
        rungs = json.loads(done.stdout)
    except ValueError:
        return [Stop("A", "refusal", (done.stderr or done.stdout).strip()[-400:])]
    rungs = rungs if isinstance(rungs, list) else rungs["gates"]
    kept = GATES[: GATES.index(LAST[base]) + 1]
    return [
        Stop(rung["gate"], "refusal", f"proof: {rung['note']}")
        for rung in rungs
        if rung["verdict"] == "REFUSED" and rung["gate"] in kept
    ]


def count(expected: Expected, seen: Seen) -> Count:
    """Right gate and right reason; stopped elsewhere or for another reason; not at all.

    The gate is the lowest that stops, or the lowest that gives the expected reason where a gate
    below it is stopped only for one candidate and lets the other one go on.
    """
    if not seen.stops:
        return "not at all"
    right = [stop for stop in seen.stops if stop.gate == expected.gate and expected.names(stop)]
    lowest = min(stop.gate for stop in seen.stops)
    return "right" if right and lowest == expected.gate else "elsewhere"


def of_candidate(seen: Seen, candidate: str, *, twin: str = "") -> Seen:
    """What stops one candidate: what speaks of it, and what speaks of nobody in particular.

    Args:
        seen: Of the whole workspace.
        candidate: Whose.
        twin: Another candidate; what stops that one for the same reason is left out.
    """
    others = {(stop.gate, stop.reason) for stop in seen.stops if twin and stop.candidate == twin}
    stops = tuple(
        stop
        for stop in seen.stops
        if stop.candidate in ("", candidate) and (stop.gate, stop.reason) not in others
    )
    return replace(seen, stops=stops)


def _said(sentence: str, lines: list[str]) -> str:
    """The sentence of a stage; of a command of the product that is no stage, its last lines."""
    if not re.search(r"ended with code \d+$", sentence):
        return sentence
    before = [line for line in lines if line.strip() and not line.startswith("ERROR: ")]
    return " ".join(before[-2:]) or sentence


def refused_by(stage: str, sentence: str) -> Stop | None:
    """The stop that a stage announces; None where a report says it better."""
    refused = REFUSES.search(sentence)
    if refused is None:
        output = OUTPUT.match(sentence)
        if output and not stage:
            stage = output["folder"]
        return Stop(GATE_OF_STAGE.get(stage, "A"), "refusal", sentence or "dvc itself")
    if REFUSED_CRITERION.match(refused["what"]) and not refused["what"].startswith("report"):
        return None
    return Stop(refused["gate"], "refusal", sentence)


def _numbers(criterion: dict[str, object]) -> str:
    limit = f"{criterion['comparison']} {criterion['threshold']}"
    return f"{criterion['measured']}, limit {limit} ({str(criterion['caveat'])[:160]})"


def _single(workspace: Path) -> bool:
    """A synthetic base has evidence that no stage of its own can write again."""
    return (workspace / "SYNTHETIC").is_file()
