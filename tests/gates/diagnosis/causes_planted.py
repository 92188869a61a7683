"""Causes planted in the synthetic evidence: what is done, who sees it, and what must be said.

Each is what its symptom may come from, in the table that records it; the gates judge it as any
other evidence, and the query has to name it among all that it is shown.
"""

import evidence
import pandas as pd
from editing import cells

FLOW = "flow"


def table(path, change):
    """An edit of one table."""
    return lambda root: evidence.edit_table(root, path, change)


def document(path, change):
    """An edit of one document."""
    return lambda root: evidence.edit_document(root, path, change)


def of_flow(frame):
    return frame["method"] == FLOW


def every_second_right_and_failing(frame):
    """Flow goes right on odd starts, and fails there."""
    right = of_flow(frame) & (frame["start"] % 2 == 1)
    frame.loc[right, ["mode", "success", "outcome"]] = ["right", False, "collision"]
    return frame


def later(column, seconds):
    def change(frame):
        frame.loc[of_flow(frame), column] += seconds
        return frame

    return change


def slow_projection(frame):
    frame.loc[of_flow(frame) & (frame["component"] == "project"), "seconds"] += 0.05
    return frame


def jumps(column, factor):
    def change(frame):
        frame.loc[of_flow(frame), column] *= factor
        return frame

    return change


def another_normalisation(matched):
    matched["differing_keys"][FLOW].append("normalisation.action")


def unnoticed(layer, name):
    def change(mutants):
        for entry in mutants:
            if (entry["layer"], entry["check"]) == (layer, name):
                entry["detected"] = False

    return change


def wall_clock_misses(frame):
    """By the wall clock flow misses every second deadline, as diffusion does in this evidence."""
    late = of_flow(frame) & (frame["clock"] == "wall") & (frame["invocation"] % 2 == 1)
    frame.loc[late, ["missed", "discarded_by", "replaced"]] = [True, "expired", False]
    return frame


def another_training(frame):
    """A second training of flow on the same starts, which fails everywhere."""
    other = frame[of_flow(frame)].copy()
    other["seed"], other["success"], other["outcome"] = 1, False, "collision"
    return pd.concat([frame, other], ignore_index=True)


def other_resets(frame):
    """Flow begins its first starts where nobody else does."""
    frame.loc[of_flow(frame) & (frame["start"] < 5), "start_sha256"] += "x"
    return frame


def without_exposure(frame):
    """Nobody measured or declared how long flow's frames are exposed."""
    return frame[~(of_flow(frame) & (frame["component"] == "exposure"))]


def half_the_states(frame):
    """Every method begins odd starts where the even ones begin."""
    states = frame["perturbation"] + (frame["start"] // 2).astype(str)
    return frame.assign(start_sha256=states)


def right_is_moved(frame):
    frame.loc[of_flow(frame) & (frame["mode"] == "right"), "position_change_m"] = 0.05
    return frame


def corrupted_passes(frame):
    layers = ["representation", "kinematic", "geometric", "dynamic", "contact", "fresh"]
    through = of_flow(frame) & (frame["fixture"] == "collision")
    frame.loc[through, layers] = True
    frame.loc[through, ["outcome", "first_reason"]] = ["passed", ""]
    return frame


def refused_by_jerk(frame):
    """Three in four of flow's held-out candidates are refused by the dynamic layer."""
    held = of_flow(frame) & (frame["fixture"] == "held_out") & (frame["candidate"] > 0)
    frame.loc[held, ["outcome", "first_reason", "dynamic"]] = ["failed", "joint_jerk", False]
    frame.loc[held, ["contact", "fresh"]] = None
    return frame


def not_representable(frame):
    """Three in four of flow's held-out candidates are refused by the representation layer."""
    held = of_flow(frame) & (frame["fixture"] == "held_out") & (frame["candidate"] > 0)
    frame.loc[held, ["outcome", "first_reason", "representation"]] = ["failed", "finite", False]
    behind = ["kinematic", "geometric", "dynamic", "contact", "fresh"]
    frame[behind] = frame[behind].astype(object)
    frame.loc[held, behind] = None
    return frame


def phase_change_miscounted(frame):
    wrong = of_flow(frame) & (frame["fixture"] == "phase_change_on_the_way")
    frame.loc[wrong, "reason"] = "expired"
    return frame


STUB = "stress/stub.parquet"
ROLLOUTS = "stress/rollouts.parquet"
SHADOW = "shadow/candidates.parquet"
CHUNKED = cells("admissible", 16, where=lambda f: f["method"] == "chunked_bc")
# Symptom, which inspection speaks, edit, gates that see it, what has to be said.
CAUSES = (
    ("diverse-unsuccessful", "first", table(ROLLOUTS, every_second_right_and_failing), "D",
     "mode right fails where mode left succeeds"),
    ("diverse-unsuccessful", "first",
     table("audit/predictions.parquet", cells("told_lower", 0.6)), "A", "told_share"),
    ("diverse-unsuccessful", "then", table(SHADOW, refused_by_jerk), "C", "admissible_share"),
    ("between-modes", "first", table("audit/clocks.parquet", evidence.lags_apart), "A",
     "lag_spread_rows: 4"),
    ("between-modes", "then", table("measure_baselines/modes.parquet", CHUNKED), "A",
     "chunking_valid_share"),
    ("boundary-jump", "first", table("stress/splices.parquet", jumps("jump_m", 6.0)), "D",
     "joining or projection makes the jump"),
    ("boundary-jump", "first", table("stress/splices.parquet", jumps("raw_jump_m", 3.0)), "D",
     "successive plans disagree"),
    ("boundary-jump", "then", document("train_generators/matched.json", another_normalisation),
     "B", "unmatched_keys: 1, required <= 0. Flow.normalisation.action"),
    ("boundary-jump", "then", table("stress/invocations.parquet", later("latency_s", 0.5)), "D",
     "latency_p95_s"),
    ("fast-microbenchmark", "first", table("latency/latency.parquet", slow_projection), "B",
     "flow samples soonest and diffusion is through sooner"),
    ("fast-microbenchmark", "then", table("stress/invocations.parquet", later("latency_s", 0.05)),
     "D", "flow samples soonest, and in motion diffusion answers sooner"),
    ("contact-oscillation", "first", table(STUB, cells("stale", 3, where=of_flow)), "D",
     "stub_violations"),
    ("contact-oscillation", "first", table("shadow/counts.parquet", phase_change_miscounted), "C",
     "phase_change_on_the_way: 0 of 12"),
    ("contact-oscillation", "then", table(ROLLOUTS, cells("force_peak_n", 50.0, where=of_flow)),
     "D", "force_peak_p95_n"),
    ("simulation-only", "first", table("wall_clock/invocations.parquet", wall_clock_misses), "D",
     "the wall clock differs from the virtual one: "),
    ("simulation-only", "first", table("latency/latency.parquet", without_exposure), "B",
     "latency_terms_missing: 1, required <= 0. missing: exposure"),
    ("simulation-only", "then",
     document("shadow/mutants.json", unnoticed("execution", "controller_mode")), "C",
     "execution.controller_mode can be left out and nobody notices"),
    ("seed-variance", "first",
     table(ROLLOUTS, other_resets), "D", "unmatched_starts"),
    ("seed-variance", "first", table(ROLLOUTS, half_the_states), "D",
     "starts repeat: 80 of them begin in 40 states"),
    ("seed-variance", "then", table(ROLLOUTS, another_training), "D",
     "trainings differ: seed 1 succeeds in 0 to"),
    ("seed-variance", "then", table("reload/modes.parquet", cells("fewest_admissible", 0)), "B",
     "mode_coverage_lower"),
    ("frequent-projection", "first", table("reload/modes.parquet", cells("fewest_admissible", 0)),
     "B", "mode_coverage_lower"),
    ("frequent-projection", "then", table(SHADOW, not_representable), "C",
     "the representation is wrong for the robot: its layer alone refuses"),
    ("frequent-projection", "then", table(SHADOW, right_is_moved), "C",
     "projection moves mode right beyond the limit and mode left not"),
    ("ood-does-not-stop", "first", table(SHADOW, corrupted_passes), "C",
     "corrupted_refused_share"),
    ("ood-does-not-stop", "then",
     document("shadow/mutants.json", unnoticed("execution", "watchdog")), "C",
     "execution.watchdog can be left out and nobody notices"),
)  # fmt: skip
