"""The whole report of Gate B, of even and of uneven evidence, as it was read last."""

import evidence
import pandas as pd
from as_told import hold, told
from drawn import hold_pictures

from gates.proof import judge


def _flow(frame):
    return frame["method"] == "flow"


def _again(frame):
    """The same rows of a second training seed, of one candidate."""
    return pd.concat([frame, frame[_flow(frame)].assign(seed=1)], ignore_index=True)


def _modes(earlier):
    def change(frame):
        frame = _again(frame)
        n = frame["index"] + 5 * frame["seed"] + 2 * _flow(frame)
        return frame.assign(
            episode_uuid=[f"e{i % 24}" for i in frame["index"]],
            fewest_admissible=1 + (n % (8 - 3 * frame["seed"]) > 0) * 3,
            modes_covered=2 - (n % 11 == 0),
            between_modes=n % 3,
            far_from_modes=(n % 7 == 0) * 1,
            valid=16 - n % 4 - earlier * (n % 5 == 0),
        )

    return change


def _timed(frame):
    n = frame["repeat"] + 3 * frame["process"] + 5 * frame["run"]
    return frame.assign(
        seconds=frame["seconds"] * (1 + 0.003 * (n % 7)) * (1 + 0.02 * frame["run"])
    )


def _latency(frame):
    unknown = (frame["component"] == "queue") & _flow(frame)
    return _timed(frame).assign(seconds=lambda f: f["seconds"].mask(unknown))


def _named(frame):
    """The same situations: six episodes have two, of two phases."""
    own = frame["index"].isin(evidence.NAMED)
    second = own & (frame["index"] // 24 > 0)
    return frame.assign(
        episode_uuid=frame["episode_uuid"].mask(own, "e" + (frame["index"] % 24).astype(str)),
        phase=frame["phase"].mask(second, "align"),
    )


def _configured(document):
    flow = document["methods"]["flow"]
    flow["parameters"]["total"] = 102
    flow["config"]["training"]["batch_size"] += 1
    document["differing_keys"]["flow"] = ["head", "training.batch_size"]


def _identity(document):
    document["flow"].update(nonfinite_weights=2, metadata_mismatches=1, normalisation="")
    document["flow"]["seed"] = [0, 1]
    document["flow"]["checkpoints"] *= 2


def _learning(root):
    for stage, method, fall in (
        ("train_baselines", "act", 0.06), ("train_baselines", "bc", -0.02),
        ("train_generators", "flow", 0.11),
    ):  # fmt: skip
        rows = evidence.validation(fall)
        path = f"{stage}/{method}/seed_0/validation.parquet"
        evidence.table(root, path, evidence.ValidationRow, rows)
    evidence.record(root)


def test_gate_b_of_even_evidence_says_what_it_said(ladder):
    hold("gate_b", told(judge(ladder, "B")))


def _make_uneven(ladder, latency):
    for table, change in (
        ("reload/modes", _modes(0)), ("reload/modes_earlier", _modes(1)),
        ("reload/nfe", lambda f: _again(f).assign(counted=8 + _flow(_again(f)))),
        ("reload/samples", lambda f: f.assign(
            sha256_reloaded=f["sha256_reloaded"].mask(_flow(f) & (f["row"] > 5), "0" * 64),
            max_abs_difference=0.125 * (_flow(f) & (f["row"] > 5)) * (f["row"] - 5),
        )),
        ("latency/latency", latency), ("audit/neighbourhoods", _named),
    ):  # fmt: skip
        evidence.edit_table(ladder, f"{table}.parquet", change)
    evidence.edit_document(ladder, "train_generators/matched.json", _configured)
    evidence.edit_document(ladder, "reload/identity.json", _identity)
    _learning(ladder)


def test_gate_b_of_uneven_evidence_says_what_it_said(ladder):
    _make_uneven(ladder, _latency)
    report = judge(ladder, "B")
    assert all(c.measured is not None for c in report.criteria)
    hold("gate_b_uneven", told(report))


def test_gate_b_of_uneven_evidence_draws_what_it_drew(ladder):
    """With every time known: of an unknown one no figure of times is drawn."""
    _make_uneven(ladder, _timed)
    hold_pictures("gate_b_drawn", "B", ladder, judge(ladder, "B"))
