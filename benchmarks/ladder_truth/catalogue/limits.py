"""Wrongs in the limits and settings by which gates judge."""

from collections.abc import Callable
from typing import Any

from benchmarks.ladder_truth.outcome import Expected
from benchmarks.ladder_truth.planting import Plant, Wrong, all_of
from benchmarks.ladder_truth.workspace import edit_params, set_limit

E = "E"
CHAIN = ("upstream_passed", "signature_valid")
# Any change voids a signed chain; these must be stopped for what they are.
RECOVERY = r"recovery_success_lower is .*expected >="
LATENCY = r"latency_p95_s is .*expected <="
OUTSIDE = r"outside_modes_upper is .*expected <="


def _params(change: Callable[[dict[str, Any]], Any]) -> Plant:
    return lambda workspace: edit_params(workspace, change)


def _entry(gate: str, name: str, change: Callable[[dict[str, Any], str], Any]) -> Plant:
    """Change the entry of one criterion, whoever owns it."""

    def edit(params: dict[str, Any]) -> None:
        for entries in params[gate]["limits"].values():
            if name in entries:
                change(entries, name)

    return _params(edit)


def _waived(gate: str, *names: str) -> Plant:
    """Declare criteria not applicable, each by its owner, in place of their limits."""

    def edit(params: dict[str, Any]) -> None:
        for owner, entries in params[gate]["limits"].items():
            for name in [name for name in names if name in entries]:
                del entries[name]
                waived = params[gate].setdefault("not_applicable", {})
                waived.setdefault(owner, {})[name] = "no"

    return _params(edit)


def _loosened(gate: str, name: str, limit: float) -> Plant:
    return lambda workspace: set_limit(workspace, gate, name, limit)


WRONGS = (
    Wrong("no_limits_at_all", "limits", "Gate C has no limit.",
          "small", _params(lambda p: p["gate_c"]["limits"].clear()),
          Expected("C", ("stub_stale", "mode_admissible_gap"), refusal=r"limit")),
    Wrong("a_limit_is_missing", "limits", "Nobody says how far reloaded samples may differ.",
          "small", _entry("gate_b", "samples_difference", lambda e, n: e.pop(n)),
          Expected("B", ("samples_difference",), refusal=r"samples_difference")),
    Wrong("a_limit_is_nan", "limits", "The limit on stale actions is not a number.",
          "small", _entry("gate_c", "stub_stale", lambda e, n: e[n].__setitem__(0, float("nan"))),
          Expected("B", ("stub_stale",), refusal=r"stub_stale|nan|NaN|finite"),
          note="Named for Gate C at first; the stage `candidates`, with which Gate B begins, reads "
          "the whole file since, and refuses it. Moved after that run."),
    Wrong("a_limit_without_a_reason", "limits", "Somebody moved a limit and took its reason away.",
          "small", _entry("gate_b", "nfe_mismatch", lambda e, n: e.__setitem__(n, 3)),
          Expected("B", ("nfe_mismatch",), refusal=r"nfe_mismatch|reason")),
    Wrong("the_checker_is_waived", "limits",
          "The independent checker is declared not applicable.",
          "small", _waived("gate_c", "checker_violations"),
          Expected("C", refusal=r"checker_violations")),
    Wrong("training_split_is_held_out", "limits",
          "Situations of the training split count as held out.",
          "small",
          _params(lambda p: p["gate_a"].update(held_out_splits=["train", "validation", "test"])),
          Expected("A", ("held_out_situations",), refusal=r"held_out_splits|train"),
          note="Not stopped at first; refused since, see `held_out_splits`."),
    Wrong("a_misspelt_setting", "limits", "A setting is misspelt, so its default would stand.",
          "small",
          _params(lambda p: p["gate_c"].update(mode_observation=p["gate_c"].pop(
              "mode_observations"))),
          Expected("C", refusal=r"mode_observation")),
    Wrong("fixtures_are_not_required", "limits",
          "Gate C does not ask for the corrupted fixtures any more.",
          "signed", _params(lambda p: p["gate_c"].update(required_fixtures=["phase_change"])),
          Expected(E, CHAIN, refusal=r"required_fixtures"),
          note="Was planted in a rehearsal, which may leave some out and says so, and of which no "
          "card can be signed: not stopped there."),
    Wrong("stricter_than_it_is", "limits",
          "A limit that the evidence does not hold stands in params.yaml.",
          "small", _loosened("gate_b", "parameter_budget_deviation", 0.001),
          Expected("B", ("parameter_budget_deviation",)),
          note="Was `validation_fall_upper`, stopped as named; that criterion is no more."),
    Wrong("protective_limit_loosened", "limits",
          "Three stale actions at the stub are allowed, in a ladder that is no rehearsal.",
          "signed", _loosened("gate_d", "stub_violations", 3),
          Expected(E, CHAIN, refusal=r"stub_violations")),
    Wrong("force_without_a_ceiling", "limits",
          "A contact of any force is allowed, in a ladder that is no rehearsal.",
          "signed", _loosened("gate_d", "force_peak_p95_n", 1e6),
          Expected(E, CHAIN, refusal=r"force_peak_p95_n")),
    Wrong("two_starts", "limits", "Two starts are to be enough for a trial.",
          "signed", _params(lambda p: p["stress"].update(starts=2)),
          Expected(E, CHAIN, refusal=r"starts")),
    Wrong("alpha_of_one_half", "limits",
          "A wrong promotion every other time is allowed.",
          "signed", _params(lambda p: p["stress"].update(alpha=0.5)),
          Expected(E, CHAIN, refusal=r"alpha")),
    Wrong("limit_loosened_after_signing", "limits",
          "A limit of gate D was loosened after the card was signed.",
          "signed", _loosened("gate_d", "nominal_success_lower", 0.3),
          Expected(E, CHAIN, refusal=r"nominal_success_lower|gate_d"),
          note="Was .1, which the code refuses by itself since."),
    Wrong("every_recovery_may_fail", "limits",
          "No recovery has to succeed, in a ladder that is no rehearsal.",
          "signed", _loosened("gate_d", "recovery_success_lower", 0.0),
          Expected(E, CHAIN, refusal=RECOVERY, said=RECOVERY)),
    Wrong("recovery_and_latency_are_not_asked", "limits",
          "Recovery and latency are declared not applicable, though recovery is drilled: so Gate D "
          "once promoted with every recovery failed and answers after nine seconds.",
          "signed", _waived("gate_d", "recovery_success_lower", "latency_p95_s"),
          Expected(E, CHAIN, refusal=RECOVERY, said=RECOVERY)),
    Wrong("latency_is_not_asked", "limits",
          "Latency is declared not applicable, in a ladder that is no rehearsal.",
          "signed", _waived("gate_d", "latency_p95_s"),
          Expected(E, CHAIN, refusal=LATENCY, said=LATENCY)),
    Wrong("samples_between_the_modes_are_welcome", "limits",
          "Nearly all samples may lie between the modes, in a ladder that is no rehearsal.",
          "signed", _loosened("gate_b", "outside_modes_upper", 0.9),
          Expected(E, CHAIN, refusal=OUTSIDE, said=OUTSIDE)),
    Wrong("becomes_a_rehearsal", "limits",
          "The ladder of a signed card is declared a rehearsal, with looser limits.",
          "signed",
          all_of(_params(lambda p: p.update(rehearsal=True)),
                 _loosened("gate_c", "stub_stale", 5)),
          Expected(E, CHAIN, refusal=r"rehearsal")),
)  # fmt: skip
