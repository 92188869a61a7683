"""What Gate A measures: data semantics, modes, strata, recovery, baselines.

Each measure reads evidence and returns one number with its interval and caveat; none decides.
"""

from collections.abc import Sequence

import numpy as np
import pandas as pd

from gates.bounds import counted_interval, share_interval
from gates.cause import Cause, CauseLimits, name_cause, read_numbers
from gates.engine import Case, Measured
from gates.evidence import Evidence, MissingEvidenceError, count, flags, number, numbers
from genpolicy.errors import BadInputError
from genpolicy.statistics.intervals import clopper_pearson

AUDIT = "artifacts/audit"
BASELINES = "artifacts/baselines"
REFUSALS = "artifacts/ingest/refusals.json"
VALID_CAUSE = "valid_modes"


def refused_recordings(case: Case) -> Measured:
    """Recordings that ingest neither accepted nor refused: |accepted + refused - found|."""
    document = case.evidence.document(REFUSALS)
    found, accepted = number(document, "found"), number(document, "accepted")
    refused = count(document, "refused")
    if found == 0:
        raise MissingEvidenceError("no recordings were found")
    text = f"{found:g} found, {accepted:g} accepted, {refused:g} refused"
    return Measured(abs(accepted + refused - found), caveat=text)


def clock_residual(case: Case) -> Measured:
    """Largest clock offset left after realignment over streams and epochs, s."""
    frame = case.evidence.frame(f"{AUDIT}/clocks.parquet", "stream", "epoch", "offset_after_s")
    return Measured(float(np.abs(numbers(frame, "offset_after_s")).max()))


def lag_spread(case: Case) -> Measured:
    """Largest spread over epochs of the lag of one stream, action steps."""
    frame = case.evidence.frame(f"{AUDIT}/clocks.parquet", "stream", "epoch", "lag_steps")
    lags = frame.assign(lag_steps=numbers(frame, "lag_steps")).groupby("stream")["lag_steps"]
    return Measured(float((lags.max() - lags.min()).max()), caveat="largest over streams")


def calibration_residual(case: Case) -> Measured:
    """Largest calibration residual over epochs, m."""
    frame = case.evidence.frame(f"{AUDIT}/calibration.parquet", "epoch", "residual_m")
    return Measured(float(np.abs(numbers(frame, "residual_m")).max()), caveat="largest over epochs")


def label_disagreement(case: Case) -> Measured:
    """Upper exact bound of the share of labels that replay contradicts."""
    frame = case.evidence.frame(f"{AUDIT}/replay.parquet", "episode_uuid", "label", "replayed")
    wrong = int((frame["label"] != frame["replayed"]).sum())
    interval = counted_interval(wrong, len(frame), confidence=case.params.confidence)
    text = f"{wrong} of {len(frame)} replayed episodes disagree; judged by the upper bound"
    return Measured(interval[1], interval, text)


def _held_out(case: Case, *columns: str) -> pd.DataFrame:
    path = f"{AUDIT}/neighbourhoods.parquet"
    frame = case.evidence.frame(path, "split", "episode_uuid", "two_mode", *columns)
    return frame[frame["split"].isin(case.params.held_out_splits)]


def held_out_situations(case: Case) -> Measured:
    """Held-out situations that were examined."""
    rows = _held_out(case)
    return Measured(float(len(rows)), caveat=f"from {rows['episode_uuid'].nunique()} episodes")


def multimodal_situations(case: Case) -> Measured:
    """Held-out situations with two clusters that persist."""
    rows = _held_out(case, "persistent")
    kept = rows[flags(rows, "two_mode") & flags(rows, "persistent")]
    text = f"from {kept['episode_uuid'].nunique()} episodes; two clusters that persist"
    return Measured(float(len(kept)), caveat=text)


def persistence_margin(case: Case) -> Measured:
    """Persistence of mode identity above the 95 % quantile of the shuffled-time null."""
    document = case.evidence.document(f"{AUDIT}/persistence.json")
    observed, null = number(document, "observed"), number(document, "null_q95")
    text = f"observed {observed:.4g}, 95 % quantile of the shuffled-time null {null:.4g}"
    return Measured(observed - null, caveat=text)


def mode_success(case: Case) -> Measured:
    """Lowest exact lower bound of success over the modes."""
    columns = ("mode", "episodes", "successes")
    frame = case.evidence.frame(f"{AUDIT}/modes.parquet", *columns)
    bounds = [
        (counted_interval(hits, trials, confidence=case.params.confidence), str(mode))
        for mode, trials, hits in zip(
            frame["mode"],
            numbers(frame, "episodes"),
            numbers(frame, "successes"),
            strict=True,
        )
    ]
    interval, mode = min(bounds)
    text = f"lowest over {len(bounds)} modes, at {mode}; exact lower bound"
    return Measured(interval[0], interval, text)


def mode_feasible(case: Case) -> Measured:
    """Lowest share of admissible modal chunks over the modes."""
    columns = ("mode", "admissible", "checked")
    frame = case.evidence.frame(f"{AUDIT}/modes.parquet", *columns)
    checked = numbers(frame, "checked")
    if not np.all(checked > 0):
        raise MissingEvidenceError("a mode has no checked chunk")
    shares = numbers(frame, "admissible") / checked
    worst = int(np.argmin(shares))
    text = f"lowest over {len(shares)} modes, at {frame['mode'].iloc[worst]}"
    return Measured(float(shares[worst]), caveat=text)


def mean_defeated(case: Case) -> Measured:
    """Lower bound of the share of two-mode situations in which only the mean is rejected."""
    rows = _held_out(case, "clusters", "mean_admissible", "modes_admissible")
    rows = rows[flags(rows, "two_mode")]
    if len(rows) == 0:
        return Measured(0.0, caveat="no held-out situation has two modes")
    if rows["mean_admissible"].isna().any():
        raise MissingEvidenceError("the mean was not checked in every two-mode situation")
    valid = numbers(rows, "modes_admissible") >= numbers(rows, "clusters")
    defeated = valid & ~flags(rows, "mean_admissible")
    share, lower, upper = share_interval(
        defeated,
        list(rows["episode_uuid"]),
        confidence=case.params.confidence,
        favourable=True,
    )
    text = (
        f"share {share:.4g} of {len(rows)} situations; lower bound over "
        f"{rows['episode_uuid'].nunique()} episodes, whose situations are not independent"
    )
    return Measured(lower, (lower, upper), text)


def strata_effect(case: Case) -> Measured:
    """Largest effect among strata that are significant after correction; 0 if none is."""
    columns = ("variable", "phase", "p_adjusted", "effect", "effect_lower", "effect_upper")
    frame = case.evidence.frame(f"{AUDIT}/strata.parquet", *columns)
    effects = np.abs(numbers(frame, "effect"))
    significant = numbers(frame, "p_adjusted") <= case.params.strata_level
    if not significant.any():
        return Measured(0.0, caveat=f"none of {len(frame)} strata is significant after Holm")
    row = int(np.argmax(np.where(significant, effects, -np.inf)))
    chosen = frame.iloc[row]
    ends = (chosen["effect_lower"], chosen["effect_upper"])
    interval = (float(ends[0]), float(ends[1])) if np.all(np.isfinite(ends)) else None
    text = f"{chosen['variable']} in {chosen['phase']} explains modes"
    return Measured(float(effects[row]), interval, text)


def recovery_benefit(case: Case) -> Measured:
    """Lower bound of recovery by the best mode minus recovery by the worst other one."""
    columns = ("split", "mode", "episodes", "successes")
    frame = case.evidence.frame(f"{AUDIT}/recovery.parquet", *columns)
    frame = frame.assign(episodes=numbers(frame, "episodes"), successes=numbers(frame, "successes"))
    by_mode = frame.groupby("mode")[["episodes", "successes"]].sum()
    bounds = {
        str(mode): clopper_pearson(
            int(row["successes"]), int(row["episodes"]), case.params.confidence
        )
        for mode, row in by_mode.iterrows()
    }
    best = max(bounds, key=lambda mode: bounds[mode])
    others = {mode: ends for mode, ends in bounds.items() if mode != best}
    if not others:
        return Measured(0.0, caveat=f"only {best} was seen to recover, so there is no comparison")
    other = min(others, key=lambda mode: others[mode][1])
    interval = (bounds[best][0] - others[other][1], bounds[best][1] - others[other][0])
    text = f"recovery by {best} against recovery by {other}; lower bound"
    return Measured(interval[0], interval, text)


def cause_accepted(case: Case) -> Measured:
    """1 if the audit attributes the modes to the task itself, else 0."""
    cause = found_cause(case.evidence, case.extra["cause_limits"])
    return Measured(float(cause.name == VALID_CAUSE), caveat=f"cause: {cause.text}")


def found_cause(evidence: Evidence, limits: CauseLimits | None) -> Cause:
    """The cause that the audit's numbers name under the limits of this gate.

    Raises:
        MissingEvidenceError: Numbers or limits are missing.
        ConfigError: A limit lies below what the audit looked for.
    """
    if limits is None:
        raise MissingEvidenceError("params.yaml: gate_a lacks limits of the cause")
    try:
        numbers, draws = read_numbers(
            lambda name: evidence.document(f"{AUDIT}/{name}"),
            lambda name: evidence.rows(f"{AUDIT}/{name}"),
        )
    except BadInputError as error:
        raise MissingEvidenceError(str(error)) from error
    return name_cause(numbers, draws, limits)


def baselines_matched(case: Case) -> Measured:
    """Settings in which the baselines differ although no whitelist allows it."""
    return unmatched_keys(case.evidence, f"{BASELINES}/matched.json", case.params.baselines)


def unmatched_keys(evidence: Evidence, path: str, methods: Sequence[str]) -> Measured:
    """Settings in which methods differ although no whitelist allows it.

    Raises:
        MissingEvidenceError: A method is not compared.
    """
    document = evidence.document(path)
    differing, allowed = document.get("differing_keys"), document.get("whitelist")
    if not isinstance(differing, dict) or not isinstance(allowed, list):
        raise MissingEvidenceError(f"{path} has no differing_keys or no whitelist")
    bad = []
    for method in methods:
        if not isinstance(differing.get(method), list):
            raise MissingEvidenceError(f"{path} does not compare {method}")
        bad += [f"{method}.{key}" for key in differing[method] if key not in allowed]
    text = "; ".join(bad) or f"only whitelisted keys differ ({', '.join(map(str, allowed))})"
    return Measured(float(len(bad)), caveat=text)


def baseline_coverage(case: Case) -> Measured:
    """Mode coverage of the best baseline as it is deployed, which is without drawing at random.

    What a baseline covers when its latent is drawn stands in the caveat: drawn from, it is a
    generator itself and has to pass the gates like any other candidate. Wide scatter reaches
    modes by chance, so the share of its samples that pass all six layers stands beside it.
    """
    columns = ("seed", "convention", "modes_present", "modes_covered", "samples", "admissible")
    deployed: list[tuple[float, str]] = []
    drawn: list[tuple[float, str]] = []
    admissible: dict[str, float] = {}
    for method in case.params.baselines:
        rows = case.evidence.of(f"{BASELINES}/modes.parquet", method, *columns)
        rows = rows[numbers(rows, "modes_present") >= 2]
        generative = method in case.params.generative_baselines
        if not (generative or rows["convention"].isin(case.params.deployed_conventions).any()):
            raise MissingEvidenceError(f"no two-mode situation was given to {method} as deployed")
        share = numbers(rows, "modes_covered") / numbers(rows, "modes_present")
        means = rows.assign(share=share).groupby("convention")["share"].mean()
        for name, value in means.items():
            fixed = name in case.params.deployed_conventions and not generative
            into = deployed if fixed else drawn
            into.append((float(value), f"{method}, {name}"))
            own = rows[rows["convention"] == name]
            passed = numbers(own, "admissible").sum() / numbers(own, "samples").sum()
            admissible[f"{method}, {name}"] = float(passed)
    if not deployed:
        raise MissingEvidenceError("no baseline is deployed without drawing at random")
    best, name = max(deployed)
    text = f"best of {len(deployed)} deployed conventions, by {name}"
    if drawn:
        text += "; drawn at random, as a generator: " + ", ".join(
            f"{who} {value:.3g} ({admissible[who]:.0%} of samples admissible)"
            for value, who in sorted(drawn, reverse=True)
        )
    return Measured(best, caveat=text)
