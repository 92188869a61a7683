"""Looks at motion: contact, what differs from hardware, and what must stop where nobody was."""

from gates.asked_for import INCIDENTS_ASKED_FOR
from gates.diagnosis.looking import Look
from gates.diagnosis.of_time import COUNTS, ages, declared_terms
from gates.evidence import MissingEvidenceError, counts, flags, numbers
from gates.feasibility.incidents import counted
from gates.feasibility.settings import CANDIDATES, HELD_OUT, SHADOW
from gates.stress.clocks import DIFFER, UNSEEN, UNTOLD, WALL_CLOCK, compared
from gates.stress.monitors import ALARMS, THRESHOLDS, watched_of
from gates.stress.rollouts import ROLLOUTS, STRESS
from gates.words import percents
from genpolicy.evidence.documents.shadow import MUTANTS
from genpolicy.evidence.rows.monitors import MonitorAlarmRow, MonitorThresholdRow
from genpolicy.evidence.rows.shadow import CandidateRow, ShadowHoldRow, ShadowStubRow
from genpolicy.evidence.rows.stress import ConservationRow, RolloutRow, StressCountRow

PHASE = "phase_transition"
NO_TRACE = (
    "how force and position swing in contact: tables keep the largest force of a rollout, and "
    "ticks stand in its journal alone (`genpolicy replay`)"
)
GAINS = "gains of the controller: pinned by fixtures.yaml, and varied in no rollout"
NO_HARDWARE = "no rollout on hardware is recorded, so that nothing here compares with one"
ONLY_SIMULATED = (
    "what is out of distribution in your cell: probes are those of the simulated task, and an "
    "alarm stops nothing"
)
MODE_CHECKS = ("dynamic.controller_mode", "execution.controller_mode")
STOP_CHECKS = ("execution.watchdog", "execution.stopped", "execution.after_stop")
STOP_INCIDENTS = ("policy_hang_on_the_way", "fallback_on_the_way", "cleared_stop_on_the_way")


def stale_and_phase(look: Look) -> None:
    """Do stale actions, or those of the phase before, act in contact?"""
    look.criteria("C.stub_stale", "C.incidents_miscounted", "D.stub_violations")
    look.ask(_phase_changes)


def gains_rate_and_projection(look: Look) -> None:
    """Do gains, the rate of actions or projection make it swing?"""
    look.criteria("D.force_peak_p95_n", "D.reset_upper", "D.hold_share_upper", "C.projection_p95_m")
    look.ask(_contact_layer)
    look.unknown.extend([NO_TRACE, GAINS])


def simulated_and_declared(look: Look) -> None:
    """What of camera, calibration, latency and contact was measured, and what only modelled?"""
    look.criteria(
        "A.clock_residual_s", "A.calibration_residual_m", "B.latency_terms_missing",
        "D.force_peak_p95_n",
    )  # fmt: skip
    look.ask(_two_clocks)
    look.ask(declared_terms)
    look.ask(_contact)
    look.unknown.append(NO_HARDWARE)


def age_and_controller_mode(look: Look) -> None:
    """Are actions too old for a real plant, and is the controller's mode asked for?"""
    look.criteria("C.stub_stale", "D.latency_p95_s", "D.deadline_miss_upper")
    look.ask(ages)
    look.ask(lambda one: _watched(one, MODE_CHECKS))


def threshold_and_probes(look: Look) -> None:
    """Was what must stop ever shown to the monitors, and from which threshold do they say so?"""
    look.criteria("C.corrupted_refused_share")
    look.ask(_monitors)
    look.unknown.append(ONLY_SIMULATED)


def stops_wired(look: Look) -> None:
    """Are watchdog and fallback connected, whatever a monitor says?"""
    look.criteria(
        "C.mutants_undetected", "C.incidents_miscounted", "C.checker_violations",
        "D.checker_violations", "D.fallback_share_upper", "D.recovery_success_lower",
    )  # fmt: skip
    look.ask(lambda one: _watched(one, STOP_CHECKS))
    look.ask(_stops)
    look.ask(_watchdog)


def _phase_changes(look: Look) -> None:
    rows = look.rows("D", COUNTS, StressCountRow)
    balance = look.rows("D", f"{STRESS}/conservation.parquet", ConservationRow)
    void = counts(rows[rows["reason"] == PHASE], "count").sum()
    look.number(
        "actions discarded because the phase had changed",
        f"{void:g} of {counts(balance, 'generated').sum():g}",
        f"{rows['perturbation'].nunique()} conditions", f"{COUNTS}: reason {PHASE}",
    )  # fmt: skip


def _contact_layer(look: Look) -> None:
    rows = look.rows("C", CANDIDATES, CandidateRow)
    reached = rows[(rows["fixture"] == HELD_OUT) & rows["contact"].notna()]
    if len(reached) == 0:
        raise MissingEvidenceError(f"no held-out candidate of {look.candidate} reached contact")
    refused = int((~flags(reached, "contact")).sum())
    look.number(
        "held-out candidates refused by the contact layer",
        f"{refused} of {len(reached)} that reached it",
        f"{reached['observation'].nunique()} observations", f"{CANDIDATES}: contact, {HELD_OUT}",
    )  # fmt: skip


def _two_clocks(look: Look) -> None:
    look.rows("D", ROLLOUTS, RolloutRow)
    found = compared(look.reports.evidence, look.reports.settings("D"), look.candidate)
    if found.answer == UNSEEN:
        raise MissingEvidenceError(f"the wall clock was not looked at ({found.why})")
    look.number(
        "virtual clock and wall clock, on the same recordings", found.answer,
        f"{found.episodes} episodes", f"{WALL_CLOCK}/invocations.parquet, ages.parquet",
    )  # fmt: skip
    if found.answer == DIFFER:
        look.causes.append(f"the wall clock differs from the virtual one: {found.why}.")
    if found.answer == UNTOLD:
        look.undecided.append(f"whether the two clocks agree: {found.why}")


def _contact(look: Look) -> None:
    rows = look.rows("D", ROLLOUTS, RolloutRow)
    touched = rows[numbers(rows, "force_peak_n") > 0]
    look.number(
        "starts with any contact", f"{touched['start'].nunique()} of {rows['start'].nunique()}",
        f"{len(rows)} rollouts", f"{ROLLOUTS}: force_peak_n",
    )  # fmt: skip


def _monitors(look: Look) -> None:
    """What each monitor would have said of probes; never why something did or did not stop."""
    look.rows("D", ALARMS, MonitorAlarmRow)
    look.rows("D", THRESHOLDS, MonitorThresholdRow)
    found = watched_of(look.reports.evidence, look.reports.settings("D"), look.candidate)
    for one in found.watched:
        low, high = one.coverage[1:]
        look.number(
            f"failures under probes that {one.monitor} would have said before",
            percents(low, high), f"{one.failures} failures",
            f"{ALARMS}, thresholds.parquet: {one.monitor}",
        )  # fmt: skip


def _watched(look: Look, names: tuple[str, ...]) -> None:
    """Whether leaving out a check was noticed, each time that it was left out."""
    look.rows("C", f"{SHADOW}/stub.parquet", ShadowStubRow)
    mutants = look.reports.evidence.document(SHADOW, MUTANTS)
    for name in names:
        found = [entry for entry in mutants if f"{entry.layer}.{entry.check}" == name]
        if not found:
            look.unknown.append(f"{SHADOW}/{MUTANTS.file}: nobody left out {name}")
            continue
        noticed = sum(entry.detected for entry in found)
        violations = sum(entry.violations for entry in found)
        look.number(
            f"{name} left out", f"noticed {noticed} of {len(found)} times",
            f"{violations} violations", f"{SHADOW}/{MUTANTS.file}: {name}",
        )  # fmt: skip
        if noticed < len(found):
            look.causes.append(f"{name} can be left out and nobody notices: it is not connected.")


def _stops(look: Look) -> None:
    look.rows("C", f"{SHADOW}/stub.parquet", ShadowStubRow)
    found = {item.name: item for item in counted(look.reports.evidence, look.candidate)}
    for name in STOP_INCIDENTS:
        item = found[name]
        look.number(
            f"{name.replace('_', ' ')}, counted as {INCIDENTS_ASKED_FOR[name]}",
            f"{item.counted:g} of {item.injected:g}, {item.through:g} got to the stub",
            f"{item.injected:g} chunks", f"{SHADOW}/counts.parquet: {name}",
        )  # fmt: skip


def _watchdog(look: Look) -> None:
    path = f"{SHADOW}/holds.parquet"
    rows = look.rows("C", path, ShadowHoldRow)
    for event in ("watchdog", "stop"):
        own = rows[rows["event"] == event]
        look.number(
            f"times that the supervisor said {event}", f"{counts(own, 'count').sum():g}",
            f"{own['fixture'].nunique()} fixtures and incidents", f"{path}: event {event}",
        )  # fmt: skip
