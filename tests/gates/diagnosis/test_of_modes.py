"""Looks at modes: what belongs to none is counted, and what projection does to refused ones."""

import re

import evidence
import numpy as np
import pytest
from causes_planted import FLOW, of_flow, refused_by_jerk

from gates.diagnosis.looking import Look
from gates.diagnosis.of_modes import (
    feasible_conditioning,
    modes_of_condition,
    raw_samples,
    simpler_policies,
)


def value(look, what):
    return next(one.value for one in look.numbers if one.what == what)


def test_rollouts_of_no_mode_are_counted_with_their_success(planted):
    def change(frame):
        chosen = of_flow(frame) & (frame["perturbation"] == "nominal") & (frame["start"] < 20)
        frame.loc[chosen, "mode"] = "unassigned"
        frame.loc[chosen & (frame["start"] < 5), ["success", "outcome"]] = [False, "collision"]
        return frame

    look = Look(planted(lambda root: evidence.edit_table(
        root, "stress/rollouts.parquet", change), ""), FLOW)  # fmt: skip
    modes_of_condition(look)
    said = value(look, "undisturbed rollouts that belong to no mode")
    assert said.startswith("20 of 80; success 70 % (")


def test_where_each_rollout_has_a_mode_none_is_left(honest):
    look = Look(honest, FLOW)
    modes_of_condition(look)
    assert value(look, "undisturbed rollouts that belong to no mode") == "0 of 80"


def test_refused_candidates_are_counted_where_projection_moved_them(planted):
    look = Look(planted(lambda root: evidence.edit_table(
        root, "shadow/candidates.parquet", refused_by_jerk), ""), FLOW)  # fmt: skip
    raw_samples(look)
    moved, of = value(look, "held-out candidates moved by projection").split(" of ")
    refused, of_refused = value(look, "refused held-out candidates moved by projection").split(
        " of "
    )
    assert 0 < int(of_refused) < int(of)
    assert (int(moved), int(refused)) == (int(of), int(of_refused))


def test_what_never_came_to_projection_is_counted_where_there_is_some(planted, honest):
    what = "held-out candidates that never came to projection"

    def change(frame):
        held = frame.index[of_flow(frame) & (frame["fixture"] == "held_out")]
        frame.loc[held[:3], "position_change_m"] = np.nan
        return frame

    look = Look(planted(lambda root: evidence.edit_table(
        root, "shadow/candidates.parquet", change), ""), FLOW)  # fmt: skip
    raw_samples(look)
    assert value(look, what).startswith("3 of ")
    look = Look(honest, FLOW)
    raw_samples(look)
    assert all(one.what != what for one in look.numbers)


def test_the_interval_of_a_move_goes_from_its_lower_to_its_upper_end(planted):
    """Moves that differ from episode to episode, so that the two ends are two numbers."""

    def change(frame):
        mine = frame[of_flow(frame)]
        steps = np.linspace(0.001, 0.02, len(mine))
        frame.loc[mine.index, "position_change_m"] = steps
        return frame

    look = Look(planted(lambda root: evidence.edit_table(
        root, "shadow/candidates.parquet", change), ""), FLOW)  # fmt: skip
    feasible_conditioning(look)
    said = value(look, "p95 of the move by projection in mode left")
    point, lower, upper = (float(text) for text in re.findall(r"[\d.]+(?= (?:mm|to))", said))
    assert lower < upper and lower <= point <= upper


def test_of_who_was_trained_here_conformance_is_unknown(honest):
    look = Look(honest, FLOW)
    feasible_conditioning(look)
    assert any("conformance" in text for text in look.unknown)
    said = value(look, "held-out candidates refused by the representation layer")
    assert said.startswith("0 of ")


def test_only_held_out_candidates_say_what_the_representation_refuses(planted):
    """Every corrupted candidate is refused by it, and every third of ten that were held out."""

    def change(frame):
        held = of_flow(frame) & (frame["fixture"] == "held_out")
        frame.loc[of_flow(frame) & ~held, "representation"] = False
        frame.loc[frame[held].index[:3], "representation"] = False
        return frame

    look = Look(planted(lambda root: evidence.edit_table(
        root, "shadow/candidates.parquet", change), ""), FLOW)  # fmt: skip
    feasible_conditioning(look)
    said = value(look, "held-out candidates refused by the representation layer")
    assert said.startswith("3 of ")


def test_a_share_between_modes_that_is_missing_is_not_averaged_away(planted):
    def change(frame):
        frame.loc[frame[of_flow(frame)].index[0], "between_share"] = np.nan
        return frame

    look = Look(planted(lambda root: evidence.edit_table(
        root, "reload/coverage.parquet", change), ""), FLOW)  # fmt: skip
    simpler_policies(look)
    assert any("between_share has missing" in text for text in look.unknown)
    with pytest.raises(StopIteration):
        value(look, "share between two modes, by network evaluations")
