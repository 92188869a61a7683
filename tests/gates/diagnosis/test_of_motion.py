"""Looks at motion: checks that are left out more than once, and who reached contact."""

import evidence
from causes_planted import FLOW, document, of_flow

from gates.diagnosis.looking import Look
from gates.diagnosis.of_motion import gains_rate_and_projection, stops_wired


def test_a_check_speaks_if_leaving_it_out_was_unnoticed_any_time(planted):
    """The row that nobody noticed stands before one that was noticed."""

    def change(mutants):
        (own,) = [entry for entry in mutants if entry["check"] == "watchdog"]
        mutants.insert(mutants.index(own), {**own, "detected": False})

    look = Look(planted(document("shadow/mutants.json", change), ""), FLOW)
    stops_wired(look)
    assert any("execution.watchdog can be left out and nobody notices" in c for c in look.causes)
    (number,) = [one for one in look.numbers if one.what == "execution.watchdog left out"]
    assert number.value == "noticed 1 of 2 times"


def test_candidates_that_were_corrupted_on_purpose_are_not_counted_at_contact(planted, honest):
    def contact(look):
        gains_rate_and_projection(look)
        return next(one.value for one in look.numbers if "contact layer" in one.what)

    def edit(root):
        def change(frame):
            frame.loc[of_flow(frame) & (frame["fixture"] != "held_out"), "contact"] = False
            return frame

        evidence.edit_table(root, "shadow/candidates.parquet", change)

    before = contact(Look(honest, FLOW))
    assert before.startswith("0 of ")
    assert contact(Look(planted(edit, ""), FLOW)) == before
