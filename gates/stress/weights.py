"""What costs may be weighed against a success, and by how much.

A weight is what a success loses that has this cost for the whole of the longest rollout. Every
cost is a time within one rollout, so that all have the same honest bound, and one that is weighed
twice is seen to be: the fallback drives inside the time to success.
"""

from collections.abc import Mapping

from gates.report import Owner

Weights = dict[Owner, dict[str, tuple[float, str]]]
"""By owner and cost: the weight, and the reason for it."""

DURATION, FALLBACK, RECOVERY = "duration", "fallback", "recovery"
COSTS: Mapping[str, str] = {
    DURATION: "the time until it succeeded",
    FALLBACK: "the time that the fallback drove",
    RECOVERY: "the time in recovery",
}
LEAST_OF_A_SUCCESS = 0.5
"""Whoever succeeds twice as often is never worth less, whatever either costs. A floor near 0
would let slow successes count as failures; what no success may do at all has a limit of its own."""
NOT_WEIGHED: Mapping[str, str] = {
    "reset": "a rollout that ends in a stop is no success and counts 0 already; see reset_upper",
    "intervention": "a rollout with a person is no success and counts 0; see intervention_upper",
    "compute": "operations have no largest number that one success could be held against",
    "distillation": "its share of one success hangs on how many follow, which nobody knows",
}
"""What one would like to weigh and cannot, and why."""


def require_weights(weights: Weights) -> Weights:
    """Require weights that mean what they say: none is cut off, none weighs nothing.

    Args:
        weights: By owner and cost.

    Raises:
        ValueError: An owner without a cost, an unknown cost or one that cannot be weighed, one
            under two owners, a weight that is not above 0, no reason, or more in sum than a success
            may lose.
    """
    names = [name for costs in weights.values() for name in costs]
    if bare := [owner for owner, costs in weights.items() if not costs]:
        raise ValueError(f"the {bare[0]} owner weighs no cost; leave the owner out")
    for name in names:
        if name not in COSTS:
            why = NOT_WEIGHED.get(name, f"there are {', '.join(COSTS)}")
            raise ValueError(f"`{name}` is no cost that is weighed: {why}")
    if len(set(names)) < len(names):
        raise ValueError("a cost has one owner")
    for costs in weights.values():
        for name, (weight, reason) in costs.items():
            if not weight > 0.0:
                raise ValueError(f"the weight of `{name}` must be above 0; leave out what is none")
            if not reason.strip():
                raise ValueError(f"the weight of `{name}` has no reason")
    if (total := sum(by_cost(weights).values())) > 1.0 - LEAST_OF_A_SUCCESS + 1e-9:
        raise ValueError(
            f"the weights sum to {total:.3g}, and a success keeps at least {LEAST_OF_A_SUCCESS:g}"
        )
    return weights


def by_cost(weights: Weights) -> dict[str, float]:
    """Each weight by its cost, in the order of `COSTS`."""
    found = {name: weight for costs in weights.values() for name, (weight, _) in costs.items()}
    return {name: found[name] for name in COSTS if name in found}


def listed(weights: Weights) -> str:
    """Costs and weights for a reader."""
    return ", ".join(f"{name} {weight:g}" for name, weight in by_cost(weights).items())


def explained(weights: Weights, longest_s: float) -> str:
    """What is compared, for the head of a report, with who weighs what and why."""
    parts = [
        f"{weight:g} of {COSTS[name]} (the {owner} owner: {reason})"
        for name in COSTS
        for owner, costs in weights.items()
        if name in costs
        for weight, reason in [costs[name]]
    ]
    return (
        f"Compared is utility and not success alone: a success counts 1 less {'; '.join(parts)}, "
        f"each as a share of {longest_s:g} s; everything else counts 0. A gain may be one of "
        "cheaper successes; the gain in success stands beside it. No other criterion reads it."
    )
