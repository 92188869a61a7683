"""The worlds that are asked, and what each may come to; fixed before they were run."""

from benchmarks.decision.worlds import World

MARGIN = 0.05
"""That of the shipped plan, at which worlds are built; the runner refuses another one."""
WRONG = 0.05
"""Most false promotions."""
ALL_ALIKE = 1.0
"""As `genpolicy plan` assumes: all conditions of a start end alike, which is most noise."""


def _null(name: str, what: str, baselines: tuple[float, ...], **other: object) -> World:
    """A candidate that gains just the margin over the best simple method: nobody to promote."""
    given = {"candidates": (max(baselines) + MARGIN,), "asks": ("false",), "most": WRONG, **other}
    return World(name, what, baselines=baselines, **given)  # type: ignore[arg-type]


NULLS = (
    _null("margin", "gain just the margin; one simple method close", (0.5, 0.2)),
    _null("margin_five", "the same over five equal simple methods", (0.5,) * 5),
    _null("alone", "one candidate registered, alpha .05 for it alone, peeking", (0.5, 0.2),
          registered=1, peeking=10),
    _null("peeking", "as the first, looked at after every 10 starts", (0.5, 0.2), peeking=10),
    _null("peeking_tied", "looked at every 10, all conditions of a start alike", (0.5, 0.2),
          peeking=10, conditions_alike=ALL_ALIKE),
    _null("hard_starts", "nine of ten outcomes decided by the start for all methods", (0.5, 0.2),
          methods_alike=0.9),
    _null("no_pairing", "starts say nothing: methods independent", (0.5, 0.2), methods_alike=0.0),
    _null("low", "baseline 0, candidate .05", (0.0, 0.0)),
    _null("high", "baseline .95, candidate 1", (0.95, 0.2)),
    _null("never", "nobody ever succeeds", (0.0, 0.0), candidates=(0.0,)),
    _null("always", "everybody always succeeds", (1.0, 1.0), candidates=(1.0,)),
    _null("three", "three candidates, each just at the margin, peeking", (0.5, 0.2),
          candidates=(0.55,) * 3, peeking=10),
    _null("one_condition", "all of the gain in one condition, none in seven", (0.5, 0.2),
          candidates=(0.5,), tilt=(("push", 0.4),)),
    _null("outside", "a gain of .3 everywhere but inside the envelope, where it is 0", (0.5, 0.2),
          candidates=(0.8,), tilt=(("envelope", -0.3),), asks=("false_inside",)),
    *(
        _null(f"spread_{seeds}_{spread:g}", f"training seeds differ by sd {spread:g}; {seeds} run",
              (0.5, 0.2), spread=spread, seeds=seeds, asks=("false", "false_of_method"))
        for seeds in (1, 3) for spread in (0.1, 0.15, 0.2)
    ),
)  # fmt: skip
"""False promotion at most 5 %, at the worse end of the interval."""

GRADED = (
    _null("graded", "utility: both lose .2 of a success to costs; peeking", (0.5, 0.2),
          lost=(0.2, 0.2), peeking=10),
    _null("graded_cheap", "as many successes each, worth .5 and .55: all of the gain is in costs; "
          "peeking", (0.5, 0.2), lost=(0.5, 0.45), peeking=10),
    _null("graded_dear", "utility: it always succeeds, at all costs; peeking", (0.45, 0.2),
          lost=(0.0, 0.5), peeking=10),
    _null("graded_tied", "the first, all conditions of a start alike", (0.5, 0.2), lost=(0.2, 0.2),
          peeking=10, conditions_alike=ALL_ALIKE),
    _null("graded_spread", "the first, training seeds differ by sd .15; 3 run", (0.5, 0.2),
          lost=(0.2, 0.2), peeking=10, spread=0.15, seeds=3),
    World("graded_planned", "the planned effect of utility: .8 against .5, both lose .2",
          ("promoted",), (0.5, 0.2), (0.8,), conditions_alike=ALL_ALIKE, lost=(0.2, 0.2)),
)  # fmt: skip
"""Outcomes between 0 and 1. False promotion at most 5 %; power is shown beside it."""

POWERS = (
    World("planned", "the planned effect: .8 against .5, all conditions of a start alike",
          ("promoted",), (0.5, 0.2), (0.8,), least=0.8, conditions_alike=ALL_ALIKE),
    World("planned_half", "the same, half of the starts end alike", ("promoted",), (0.5, 0.2),
          (0.8,), least=0.8),
    World("planned_five", "the same over five equal simple methods", ("promoted",), (0.5,) * 5,
          (0.8,)),
    World("planned_five_tied", "the same, all conditions of a start alike", ("promoted",),
          (0.5,) * 5, (0.8,), conditions_alike=ALL_ALIKE),
    World("planned_spread", "training seeds differ by sd .15; one runs", ("promoted",), (0.5, 0.2),
          (0.8,), spread=0.15),
    World("two_apart", "two good candidates, .85 and .7", ("worse", "either"),
          (0.4, 0.2), (0.85, 0.7), most=WRONG),
    World("worse_beside", "one good, one at the margin", ("worse", "either"),
          (0.5, 0.2), (0.8, 0.55), most=WRONG),
    World("two_alike", "two alike, .8 and .8", ("either",), (0.5, 0.2), (0.8, 0.8)),
)  # fmt: skip
"""What is found, and who is chosen."""
WORLDS = (*NULLS, *POWERS, *GRADED)
