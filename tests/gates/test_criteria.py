"""The judges A to D: every criterion can fail, never improves by getting worse, never by absence.

`WORSE` gives for each criterion an edit that makes its metric worse, by a severity from 0 to 1.
"""

import shutil

import evidence
import numpy as np
import pytest
from editing import cells

from gates.engine import _answer, promoted_below
from gates.engine import judge as judge_spec
from gates.evidence import Evidence
from gates.pipeline import TASK_IDENTITY
from gates.proof import SPECS, judge
from gates.report import report_bytes, report_path
from gates.settings import Limits, read_limits, read_params, read_settings
from genpolicy.errors import IntegrityError
from genpolicy.integrity.atomic import write_bytes

AUDIT, SHADOW, STRESS = "audit/", "shadow/", "stress/"


def _of(method):
    return lambda frame: frame["method"] == method


def _held(frame):
    return frame["fixture"] == "held_out"


def _set(key, value):
    return lambda document: document.__setitem__(key, value)


def _table(path, make):
    return lambda root, s: evidence.edit_table(root, path, make(s))


def _document(path, make):
    return lambda root, s: evidence.edit_document(root, path, make(s))


def _violations(s):
    return _set("violations", [evidence.VIOLATION] * (1 + int(3 * s)))


def _identity(key):
    return lambda s: lambda d: [e.__setitem__(key, int(3 * s) + 1) for e in d.values()] and None


def _finding(question):
    """A deviation of the data, of the severity."""
    found = lambda s: lambda _: evidence.finding(question, s)  # noqa: E731
    return _table(AUDIT + "findings.parquet", found)


def _spoken_of(root, s):
    """Fewer situations of which either kind of evidence can speak."""
    left = 90 - int(85 * s)
    evidence.edit_table(root, AUDIT + "sides.parquet", lambda f: f.assign(analysed=left))
    evidence.edit_document(
        root, AUDIT + "summary.json", lambda d: d["counts"].__setitem__("analysed", left)
    )


def _slow_together(s):
    """Every eighth invocation is slow in all of its terms; a model draws them apart."""

    def change(frame):
        hit = (frame["source"] == "measured") & (frame["temperature"] == "warm")
        slow = 0.001 * (1 + 9 * s * (frame["repeat"] == 7))
        return frame.assign(seconds=frame["seconds"].mask(hit, slow))

    return change


def _slower_in_the_second_run(temperature):
    def make(s):
        def change(frame):
            hit = (frame["run"] == 2) & (frame["temperature"] == temperature)
            return frame.assign(seconds=frame["seconds"] * np.where(hit, 2 + 2 * s, 1))

        return change

    return _table("latency/latency.parquet", make)


def _each_training(stage, methods):
    """A validation loss that falls by another tenth and more in the last quarter."""

    def worse(root, s):
        for method in methods:
            path = f"{stage}{method}/seed_0/validation.parquet"
            evidence.table(root, path, evidence.ValidationRow, evidence.validation(0.1 + 0.5 * s))
        evidence.record(root)

    return worse


def _collapse(frame, share):
    """Reject the right-hand mode in `share` of the situations with two modes."""
    bad = (frame["fixture"] == "two_modes") & (frame["mode"] == "right")
    bad &= frame["observation"] < np.ceil(60 * share)
    frame.loc[bad, "geometric"] = False
    return frame


TRAINED, BASE, GEN = "train_baselines/", "measure_baselines/", "train_generators/"


ROLL = STRESS + "rollouts.parquet"


WORSE = {
    "A": {
        "refused_recordings_accounted": _document(
            "ingest/refusals.json", lambda s: _set("accepted", 48 - int(9 * s))
        ),
        "data_defects": _table(
            AUDIT + "replay.parquet", lambda s: cells("replayed", "failure", share=s)
        ),
        "clock_residual_s": _finding("clock_residual_s"),
        "lag_spread_rows": _table(
            AUDIT + "clocks.parquet", lambda s: cells("lag_rows", 2 + 4 * s, share=0.25)
        ),
        "calibration_residual_m": _finding("calibration_residual_m"),
        "label_disagreement": _table(
            AUDIT + "replay.parquet", lambda s: cells("replayed", "failure", share=s)
        ),
        "held_out_situations": _spoken_of,
        "multimodal_situations": _document(
            AUDIT + "persistence.json", lambda s: _set("n", 200 - int(195 * s))
        ),
        "persistence_margin": _document(
            AUDIT + "persistence.json", lambda s: _set("observed", 0.95 - 0.5 * s)
        ),
        "mode_success_lower": _table(
            AUDIT + "modes.parquet", lambda s: cells("successes", 24 - int(20 * s), share=0.5)
        ),
        "mode_feasible_share": _table(
            AUDIT + "modes.parquet", lambda s: cells("admissible", 49 - int(40 * s), share=0.5)
        ),
        "mean_defeated_share": _table(
            AUDIT + "neighbourhoods.parquet", lambda s: cells("mean_admissible", True, share=s)
        ),
        "strata_effect": _table(
            AUDIT + "strata.parquet",
            lambda s: lambda f: f.assign(effect=s, effect_lower=s / 2, p_adjusted=0.001),
        ),
        "unasked_checks": _table(
            AUDIT + "asked.parquet",
            lambda s: cells("asked", False, share=s),
        ),
        "told_share": _table(
            AUDIT + "predictions.parquet",
            lambda s: lambda f: f.assign(told_lower=0.9 * s - 0.1, told_upper=0.9 * s + 0.1),
        ),
        "cause_accepted": _table(
            AUDIT + "replay.parquet", lambda s: cells("replayed", "failure", share=s)
        ),
        "baselines_matched": _document(
            TRAINED + "matched.json",
            lambda s: lambda d: d["differing_keys"]["bc"].extend(["k"] * int(1 + 3 * s)),
        ),
        "baseline_mode_coverage": _table(
            BASE + "modes.parquet",
            lambda s: cells("modes_valid", 2, where=_of("act"), share=s),
        ),
        "phase_collapse_share": _document(
            AUDIT + "summary.json", lambda s: _set("modes_with_phase", 40 - int(40 * s))
        ),
        "chunking_valid_share": _table(
            BASE + "modes.parquet",
            lambda s: cells("admissible", 16, where=_of("chunked_bc"), share=s),
        ),
        "remedy_valid_share": _table(
            BASE + "modes.parquet",
            lambda s: (
                lambda f: cells("valid", 16, where=_of("bc_noise"), share=s)(
                    cells("admissible", 16, where=_of("bc_noise"), share=s)(f)
                )
            ),
        ),
        "latent_dependence_p": _document(
            BASE + "latent.json",
            lambda s: lambda d: d[0].update(condition_share=0.0, exceeding=int(999 * s)),
        ),
        "factors_isolated": _document(
            "train_factors/variants.json",
            lambda s: (
                lambda d: d["variants"]["transformer"]["changed"].extend(["k"] * int(1 + 3 * s))
            ),
        ),
        "factor_valid_share": _table(
            "measure_factors/modes.parquet",
            lambda s: cells("admissible", 16, where=_of("transformer"), share=s),
        ),
    },
    "B": {
        "unmatched_keys": _document(
            GEN + "matched.json",
            lambda s: (
                lambda d: (
                    [v.extend(["k"] * int(1 + 3 * s)) for v in d["differing_keys"].values()]
                    and None
                )
            ),
        ),
        "parameter_budget_deviation": _document(
            GEN + "matched.json",
            lambda s: (
                lambda d: (
                    [
                        v["parameters"].__setitem__("total", 100 + int(50 * s))
                        for v in d["methods"].values()
                    ]
                    and None
                )
            ),
        ),
        "unpinned_items": _document(
            "reload/identity.json",
            lambda s: lambda d: [e.__setitem__("sampler", "") for e in d.values()] and None,
        ),
        "nonfinite_weights": _document("reload/identity.json", _identity("nonfinite_weights")),
        "metadata_mismatches": _document("reload/identity.json", _identity("metadata_mismatches")),
        "samples_difference": _table(
            "reload/samples.parquet",
            lambda s: (
                lambda f: (
                    cells("sha256_reloaded", "other")(cells("max_abs_difference", s)(f)) if s else f
                )
            ),
        ),
        "varied_difference": _table(
            "reload/variations.parquet",
            lambda s: lambda f: cells("unequal", 1)(cells("max_abs_difference", s)(f)) if s else f,
        ),
        "nfe_mismatch": _table(
            "reload/nfe.parquet", lambda s: cells("counted", 8 + int(8 * s) + 1)
        ),
        "late_change_upper": _table(
            "reload/modes_earlier.parquet", lambda s: cells("valid", 12 - int(10 * s))
        ),
        "baseline_fall_upper": _each_training(TRAINED, ("act",)),
        "mode_coverage_lower": _table(
            "reload/modes.parquet", lambda s: cells("fewest_admissible", 1, share=s)
        ),
        "outside_modes_upper": _table(
            "reload/modes.parquet", lambda s: cells("between_modes", 4 + int(12 * s))
        ),
        "latency_terms_missing": _table(
            "latency/latency.parquet",
            lambda s: (
                lambda f: f[~f["component"].isin(["queue", "network", "select"][: 1 + int(2 * s)])]
            ),
        ),
        "warm_latency_ratio_upper": _slower_in_the_second_run("warm"),
        "cold_latency_ratio_upper": _slower_in_the_second_run("cold"),
        "latency_model_ratio_upper": _table("latency/latency.parquet", _slow_together),
    },
    "C": {
        "mode_admissible_gap": _table(
            SHADOW + "candidates.parquet", lambda s: lambda f: _collapse(f, s)
        ),
        "admissible_share": _table(
            SHADOW + "candidates.parquet", lambda s: cells("kinematic", False, share=s)
        ),
        "projection_p95_m": _table(
            SHADOW + "candidates.parquet", lambda s: cells("position_change_m", s, where=_held)
        ),
        "boundary_jerk_p95_m_s3": _table(
            SHADOW + "candidates.parquet",
            lambda s: cells("boundary_jerk_m_s3", 9000 * s, where=_held),
        ),
        "corrupted_refused_share": _table(
            SHADOW + "candidates.parquet",
            lambda s: (
                lambda f: f.assign(
                    first_reason=np.where(f["observation"] < 4 * s, "", f["first_reason"])
                )
            ),
        ),
        "stub_stale": _table(SHADOW + "stub.parquet", lambda s: cells("stale", int(9 * s) + 1)),
        "stub_invalid": _table(SHADOW + "stub.parquet", lambda s: cells("invalid", int(9 * s) + 1)),
        "stub_violation_upper": _table(
            SHADOW + "stub.parquet", lambda s: cells("stale", int(100 * s))
        ),
        "conservation_error": _table(
            SHADOW + "counts.parquet", lambda s: cells("executed", 81 + int(9 * s))
        ),
        "incidents_miscounted": _table(
            SHADOW + "counts.parquet",
            lambda s: cells(
                "executed", 1 + int(9 * s), where=lambda f: f["fixture"] == "reset_on_the_way"
            ),
        ),
        "checker_violations": _document(
            SHADOW + "checker.json",
            _violations,
        ),
        "mutants_undetected": _document(
            SHADOW + "mutants.json",
            lambda s: (
                lambda d: [e.__setitem__("detected", False) for e in d[: 1 + int(4 * s)]] and None
            ),
        ),
    },
    "D": {
        "unmatched_starts": _table(
            ROLL, lambda s: cells("start_sha256", "x", where=_of("act"), share=max(s, 0.02))
        ),
        "verdict_reachable": _document(
            STRESS + "power.json",
            lambda s: lambda d: d["rows"][0].__setitem__("promote_share", 0.97 - 0.9 * s),
        ),
        "nominal_success_lower": _table(
            ROLL,
            lambda s: cells(
                "success", False, where=lambda f: f["perturbation"] == "nominal", share=s
            ),
        ),
        "deadline_miss_upper": _table(ROLL, lambda s: cells("deadline_misses", int(20 * s))),
        "latency_p95_s": _table(
            STRESS + "invocations.parquet", lambda s: cells("latency_s", 0.4 + 9 * s, share=0.1 + s)
        ),
        "hold_share_upper": _table(ROLL, lambda s: cells("hold_ticks", int(160 * s))),
        "rejection_share_upper": _table(ROLL, lambda s: cells("rejections", int(20 * s))),
        "reset_upper": _table(ROLL, lambda s: cells("outcome", "force_stop", share=s)),
        "recovery_success_lower": _table(
            ROLL,
            lambda s: cells(
                "recovered", False, where=lambda f: f["recovery_attempted"], share=0.5 + s / 2
            ),
        ),
        "fallback_share_upper": _table(ROLL, lambda s: cells("fallback_ticks", int(160 * s))),
        "intervention_upper": _table(ROLL, lambda s: cells("interventions", 1, share=s)),
        "stub_violations": _table(
            STRESS + "stub.parquet", lambda s: cells("stale", 1 + int(9 * s))
        ),
        "force_peak_p95_n": _table(ROLL, lambda s: cells("force_peak_n", 10 + 40 * s)),
        "stress_success_lower": _table(
            ROLL,
            lambda s: cells(
                "success", False, where=lambda f: f["perturbation"] != "nominal", share=s
            ),
        ),
        "conservation_error": _table(
            STRESS + "conservation.parquet", lambda s: cells("executed", 89 + int(9 * s))
        ),
        "checker_violations": _document(
            STRESS + "checker.json",
            _violations,
        ),
        "promotion_e_value": _table(
            ROLL,
            lambda s: cells(
                "success", False, share=s, where=lambda f: f["method"].isin(evidence.CANDIDATES)
            ),
        ),
    },
}


CASES = [(gate, name) for gate, cases in WORSE.items() for name in cases]


TABLES = {
    "A": [
        "audit/clocks",
        "audit/neighbourhoods",
        "audit/modes",
        "audit/strata",
        "audit/predictions",
        "audit/asked",
        "audit/replay",
        "audit/calibration",
        "measure_baselines/modes",
        "measure_factors/modes",
    ],
    "B": [
        "reload/samples",
        "reload/variations",
        "reload/compute",
        "reload/nfe",
        "reload/modes",
        "latency/latency",
    ],
    "C": ["shadow/candidates", "shadow/stub", "shadow/counts"],
    "D": [
        "stress/rollouts",
        "stress/invocations",
        "stress/stub",
        "stress/conservation",
        "stress/counts",
    ],
}


def _found(report, name):
    return [c for c in report.criteria if c.id == name]


def _answers(root, gate, name):
    """The answers to one criterion as the judge of a gate has them, the others not asked."""
    params, spec = read_params(root), SPECS[gate]
    settings = read_settings(params, f"gate_{gate.lower()}", spec.settings)
    limits = read_limits(params, gate, spec.criteria)
    (item,) = (one for one in spec.criteria if one.id == name)
    names = [None]
    if item.per_candidate:
        names, _ = promoted_below(root, spec.below, settings.candidates)
    asked = [one for one in names if not settings.excepted(name, one)]
    of, inputs, limit = Evidence(root), settings.under(limits), limits.of.get(name)
    return [_answer(item, of, inputs, limit, one) for one in asked]


@pytest.mark.parametrize("gate", "ABCD")
def test_good_evidence_passes_and_names_every_limit(gate, ladder):
    report = judge(ladder, gate)
    for name in {c.id for c in report.criteria}:
        answers = _answers(ladder, gate, name)
        assert [c.model_dump() for c in answers] == [c.model_dump() for c in _found(report, name)]
    assert report.verdict == "PASS", report.diagnosis
    assert {c.id for c in report.criteria} == evidence.limited(f"gate_{gate.lower()}")
    assert all(c.evidence and set(c.evidence) <= set(report.materials) for c in report.criteria)
    assert all(c.verdict == "PASS" for c in report.criteria)


def test_every_criterion_has_a_mutation():
    for gate, cases in WORSE.items():
        of_brought = evidence.OF_BROUGHT.get(gate, set())
        assert {item.id for item in SPECS[gate].criteria} - of_brought == set(cases)


@pytest.mark.parametrize(("gate", "name"), CASES)
def test_worse_evidence_is_red_and_measured_moves_one_way(gate, name, _ladder, tmp_path):
    """P19: growing severity never improves the number, and the worst is never PASS."""
    places = {severity: tmp_path / f"s{severity}" for severity in (0.2, 1.0)}
    for severity, copy in places.items():
        shutil.copytree(_ladder, copy)
        WORSE[gate][name](copy, severity)
    report = judge(places[1.0], gate)
    found = _found(report, name)
    values = [[c.measured for c in of] for of in (_answers(places[0.2], gate, name), found)]
    assert all(c.verdict != "PASS" for c in found), name
    assert report.verdict != "PASS"
    assert report.diagnosis
    sign = 1 if found[0].comparison == "<=" else -1
    for mild, hard in zip(*values, strict=True):
        assert hard is None or (mild is not None and sign * (hard - mild) >= 0), values


@pytest.mark.parametrize(("gate", "path"), [(g, p) for g, paths in TABLES.items() for p in paths])
def test_missing_table_is_inconclusive_never_pass(gate, path, ladder):
    evidence.replace(ladder, f"{path}.parquet", None)
    report = judge(ladder, gate)
    assert report.verdict == "INCONCLUSIVE"
    assert any("missing" in c.caveat for c in report.criteria)


@pytest.mark.parametrize(("gate", "path"), [(g, paths[-1]) for g, paths in TABLES.items()])
def test_empty_table_is_inconclusive_never_pass(gate, path, ladder):
    evidence.edit_table(ladder, f"{path}.parquet", lambda frame: frame.head(0))
    assert judge(ladder, gate).verdict == "INCONCLUSIVE"


@pytest.mark.parametrize(
    ("gate", "path", "column"),
    [
        ("A", "audit/clocks", "offset_after_s"),
        ("A", "audit/strata", "p_adjusted"),
        ("A", "audit/predictions", "told_upper"),
        ("B", "reload/samples", "max_abs_difference"),
        ("B", "reload/variations", "max_abs_difference"),
        ("B", "reload/modes", "fewest_admissible"),
        ("B", "reload/modes_earlier", "valid"),
        ("B", "train_baselines/chunked_bc/seed_0/validation", "loss"),
        ("C", "shadow/candidates", "position_change_m"),
        ("D", "stress/invocations", "latency_s"),
        ("D", "stress/rollouts", "force_peak_n"),
    ],
)
def test_nan_is_inconclusive_never_pass(gate, path, column, ladder):
    evidence.edit_table(ladder, f"{path}.parquet", cells(column, float("nan")))
    assert judge(ladder, gate).verdict == "INCONCLUSIVE"


def test_a_tested_variable_without_lower_end_is_not_taken_for_chance(ladder):
    """An effect of 0.9 whose interval is not known passed as one that begins at 0."""

    def damage(frame):
        frame.loc[0, ["p_adjusted", "effect"]] = [0.001, 0.9]
        frame.loc[0, "effect_lower"] = np.nan
        return frame

    evidence.edit_table(ladder, "audit/strata.parquet", damage)
    report = judge(ladder, "A")
    assert report.verdict == "INCONCLUSIVE"
    assert (
        "the test of operator in approach is not known" in _found(report, "strata_effect")[0].caveat
    )


@pytest.mark.parametrize("gate", "ABCD")
def test_the_task_is_material_and_without_its_identity_nothing_passes(gate, ladder):
    assert TASK_IDENTITY in judge(ladder, gate).materials
    evidence.replace(ladder, "task/identity.json", None)
    report = judge(ladder, gate)
    assert (report.verdict, report.promoted) == ("INCONCLUSIVE", None)
    assert any(TASK_IDENTITY in caveat for caveat in report.caveats)
    assert "identity" in report.diagnosis


@pytest.mark.parametrize("gate", "ABCD")
def test_emptied_limits_are_inconclusive(gate, ladder):
    evidence.write_params(ladder, lambda p: p[f"gate_{gate.lower()}"]["limits"].clear())
    report = judge(ladder, gate)
    assert report.verdict == "INCONCLUSIVE"
    assert {c.owner for c in report.criteria} == {None}


@pytest.mark.parametrize("gate", "ABCD")
def test_each_removed_limit_is_not_pass(gate, _ladder):
    params = read_params(_ladder)
    spec = SPECS[gate]
    settings = read_settings(params, f"gate_{gate.lower()}", spec.settings)
    limits = read_limits(params, gate, spec.criteria)
    found, _ = promoted_below(_ladder, spec.below, settings.candidates) if spec.below else ((), ())
    evidence_of = Evidence(_ladder)
    for name in set(limits.of) - evidence.OF_BROUGHT.get(gate, set()):
        left = Limits({key: value for key, value in limits.of.items() if key != name})
        report = judge_spec(spec, evidence_of, left, settings, candidates=found)
        assert report.verdict == "INCONCLUSIVE", name


def test_a_method_that_failed_below_does_not_stand(ladder):
    evidence.edit_table(
        ladder,
        "reload/samples.parquet",
        lambda f: cells("sha256_reloaded", "x", where=_of("flow"))(
            cells("max_abs_difference", 0.1, where=_of("flow"))(f)
        ),
    )
    for gate in "BC":
        write_bytes(ladder / report_path(gate), report_bytes(judge(ladder, gate)))
    report = judge(ladder, "C")
    assert set(report.candidates) == {"diffusion"}
    assert any("flow does not stand" in caveat for caveat in report.caveats)


def test_corrupt_table_is_an_integrity_error(repo):
    file = repo / "artifacts/audit/clocks.parquet"
    data = bytearray(file.read_bytes())
    data[len(data) // 3] ^= 0x10
    file.write_bytes(bytes(data[:-9]))
    with pytest.raises(IntegrityError, match=r"clocks\.parquet"):
        judge(repo, "A")


def test_same_evidence_same_bytes(ladder):
    for gate in "ABCD":
        assert report_bytes(judge(ladder, gate)) == report_bytes(judge(ladder, gate))
