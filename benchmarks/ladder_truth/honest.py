"""Honest changes, which must not be stopped: what a team does on any day."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from benchmarks.ladder_truth.bringing import AS_QUATERNION, IN_MM, TOGETHER, Brings
from benchmarks.ladder_truth.planting import Plant, all_of, recordings, with_metadata
from benchmarks.ladder_truth.workspace import BROUGHT, edit_params, set_limit


@dataclass(frozen=True)
class Variant:
    """One honest change.

    Attributes:
        name: Its name, unique.
        what: What was changed, in one sentence.
        base: Honest ladder that it is made in.
        plant: Makes it.
        note: What changed about it after a run, and why; empty as first written.
        together: Variants of one such name are made in one copy and run once.
        candidate: The candidate that was brought; what stops its twin as well does not count.
    """

    name: str
    what: str
    base: str
    plant: Plant
    note: str = ""
    together: str = ""
    candidate: str = ""


def _params(change: Callable[[dict[str, Any]], Any]) -> Plant:
    return lambda workspace: edit_params(workspace, change)


def _limit(gate: str, name: str, limit: float) -> Plant:
    return lambda workspace: set_limit(workspace, gate, name, limit)


def _reason(params: dict[str, Any]) -> None:
    for entries in params["gate_d"]["limits"].values():
        for entry in entries.values():
            entry[1] = f"{entry[1]}; read again"


def _renamed(workspace: Path) -> None:
    for path in sorted((workspace / BROUGHT).glob("*.mcap")):
        path.rename(path.with_name(path.name.replace("episode", "demonstration")))


def _without(workspace: Path, *names: str) -> None:
    for name in names:
        for path in workspace.glob(name):
            path.unlink()


def _comment(file: str) -> Plant:
    def plant(workspace: Path) -> None:
        path = workspace / file
        path.write_text(f"{path.read_text()}\n# Read again; nothing was changed.\n")

    return plant


def _brought(name: str, what: str, served: str, action: Mapping[str, Any] | None = None) -> Variant:
    return Variant(name, what, "small", Brings(name, served, action or {}),
                   together=TOGETHER, candidate=name)  # fmt: skip


def _note(workspace: Path) -> None:
    (workspace / "NOTES.md").write_text("What we looked at this week.\n")


HONEST = (
    Variant("nothing", "`dvc repro` once more.", "small", lambda workspace: None),
    Variant("nothing_brought", "The same on recordings of one's own.", "brought",
            lambda workspace: None),
    Variant("nothing_signed", "Gate E judged once more.", "signed", lambda workspace: None),
    Variant("stricter_limit_a", "A stricter limit of gate A that still holds.", "small",
            _limit("gate_a", "clock_residual_s", 0.005),
            note="The base holds it, and it lies below the audit's floor of 0.01 s."),
    Variant("stricter_limit_a_and_floor", "The same, with the audit's floor lowered to it, as "
            "its refusal asks.", "small",
            all_of(_limit("gate_a", "clock_residual_s", 0.005),
                   _params(lambda p: p["audit"].update(clock_floor_s=0.005))),
            note="Added after the one above was stopped; it does what the refusal says."),
    Variant("stricter_limit_b", "A stricter limit of gate B that still holds.", "small",
            _limit("gate_b", "parameter_budget_deviation", 0.04),
            note="Was `validation_fall_upper`; that criterion is no more."),
    Variant("stricter_limit_c", "A stricter limit of gate C that still holds.", "small",
            _limit("gate_c", "mode_admissible_gap", 0.9)),
    Variant("stricter_limit_d", "A stricter limit of gate D that still holds.", "small",
            _limit("gate_d", "verdict_reachable", 0.85)),
    Variant("reasons_rewritten", "Reasons of limits are worded better.", "small",
            _params(_reason)),
    Variant("one_worker", "One process instead of two.", "small",
            _params(lambda p: p["compute"].update(workers=1))),
    Variant("pages_removed", "Somebody deleted the printed pages; they are made again.", "small",
            lambda workspace: _without(workspace, "reports/*.html", "reports/*.md")),
    Variant("report_removed", "Somebody deleted a report; it is made again.", "small",
            lambda workspace: _without(workspace, "reports/gate_c.json")),
    Variant("a_note", "A file that no stage reads is added.", "small", _note),
    Variant("comment_in_a_gate", "A comment in the code of gate C.", "small",
            _comment("gates/feasibility/arrivals.py")),
    Variant("comment_in_the_card", "A comment in the code of the trial card.", "small",
            _comment("gates/card/people.py")),
    Variant("comment_in_the_queue", "A comment in the code of the queue: shadow and stress run "
            "again.", "small", _comment("genpolicy/execution/chunk_queue.py")),
    Variant("comment_in_reload", "A comment in the code that reloads candidates.", "small",
            _comment("genpolicy/evidence/reproducibility/reload.py")),
    Variant("a_recording_less", "The newest recording is left out.", "brought",
            recordings(lambda episode: None, only=lambda number: number == 69)),
    Variant("other_file_names", "The recordings have other names.", "brought", _renamed),
    Variant("operators_renamed", "Operators go by other names.", "brought",
            recordings(lambda e: with_metadata(e, operator=f"op-{e.metadata['operator']}"))),
    Variant("another_seed", "The whole ladder from another seed.", "small",
            _params(lambda p: p.update(seed=7))),
    Variant("another_seed_and_more_recordings", "The same, with twice as many recordings, as its "
            "report asks.", "small",
            _params(lambda p: (p.update(seed=7), p["record"].update(episodes=140))),
            note="Added after the one above was stopped; it does what the report says."),
    Variant("more_starts", "Six starts for each condition in place of three.", "small",
            _params(lambda p: p["stress"].update(starts=6))),
    Variant("another_seed_more_recordings_and_starts", "Another seed, twice as many recordings and "
            "eight starts, as its report asks.", "small",
            _params(lambda p: (p.update(seed=7), p["record"].update(episodes=140),
                               p["stress"].update(starts=8))),
            note="Added after the one with three starts was stopped at Gate D."),
    _brought("brought_plainly", "The flow's weights behind a server.", "plain"),
    _brought("brought_in_mm", "The same, numbers in mm, as its entry says.", "millimetres", IN_MM),
    _brought("brought_as_quaternion", "The same, turns as quaternions, as its entry says.",
             "quaternion", AS_QUATERNION),
)  # fmt: skip
