"""What a reader is told beside the numbers: the question, how to read the page, the words."""

from gates.readable import UNITS
from gates.report import Gate

QUESTIONS: dict[Gate, str] = {
    "A": "Does one observation truly admit several valid actions that simpler policies lose?",
    "B": "Is a candidate pinned, and does it come back the same: samples, NFE, latency?",
    "C": "Of many candidates, which are valid in every layer, and does anything else get through?",
    "D": "On identical starts and deadlines, is the gain larger than its cost?",
    "E": "Has an independent person read all this and signed a reduced envelope?",
}
BACK_TO: dict[Gate, str] = {
    "A": "the dataset, the observation, or the simpler policy",
    "B": "training",
    "C": "the generator, or the projection",
    "D": "the simpler policy",
    "E": "a person",
}
READING: dict[Gate, tuple[str, ...]] = {
    "A": (
        "What was demonstrated: are there two bundles, and do both succeed?",
        "Modes and their mean: is the mean refused where the modes pass, and for which reason?",
        "What explains the modes: is there a variable that nobody recorded and that would?",
        "What each part earns: would an encoder, a history or a trunk do without a generator?",
        "The criteria: is each limit one that you would sign? Then the caveats.",
    ),
    "B": (
        "The candidates above: at least one must pass everything; the others stop here.",
        "Modes against NFE: does coverage still rise at the chosen number of evaluations?",
        "Where the time goes: are the declared terms those of your cell? Which differ by run?",
        "The criteria: is each limit one that you would sign? Then the caveats.",
    ),
    "C": (
        "The waterfall: do held-out candidates stand, and do all corrupted ones fall?",
        "Size of projection: does one mode's curve lie apart, so that projection removes it?",
        "What was rejected, and why: does a reason take one phase or one mode, is any unknown?",
        "Rejected proposals: would you have refused them, for that reason and at that action?",
        "Stub, checker and mutants in the criteria: all zero, and is zero of enough arrivals?",
        "What happens on the way: is each row green, and is one missing that your cell knows?",
        "Is a corruption missing that your cell knows? Then the caveats.",
    ),
    "D": (
        "The decision above: promoting a method and returning to a simpler one are both results.",
        "Success by condition: is the gain where it matters, and which condition is missing?",
        "Costs in the worst condition, and outcomes: far from the limit, or just inside?",
        "The promotion margin and the limits: would they matter in your cell? Then the caveats.",
    ),
    "E": (
        "The card: is every field one that you can answer for?",
        "The criteria: only a person can meet those that wait; code drafts and verifies.",
        "The reports of gates A to D: their hashes are what is signed.",
    ),
}
WORDS: dict[str, str] = {
    "situation": "one recorded moment whose nearest neighbours in other episodes were compared",
    "chunk": "the actions that a policy commands from one observation",
    "mode": "a cluster of whole chunks that keeps its identity over successive observations",
    "held-out": "from episodes that no policy was trained on",
    "candidate": "a method that stands for promotion; in gate C also one sampled chunk",
    "NFE": "network evaluations spent on one sample, counted at the network",
    "admissible": "passes all six layers: representation, kinematic, geometric, dynamic, contact, "
    "fresh",
    "stub": "the stand-in for the robot's controller; it checks freshness once more",
    "mutant": "the same run with one check taken out; the independent checker must notice",
    "action age": "time from the sensor's exposure to the controller's acceptance of the action",
    "fallback": "the classical motion that drives while no admissible action is there",
    "e-value": "evidence that the gain exceeds the margin; above 1/alpha it is promoted",
    "p95": "the value that 95 of 100 do not exceed",
    "interval": "interval at the confidence under Settings, exact or over whole starts drawn "
    "again; limits are held against its worse end",
}
USED: dict[Gate, tuple[str, ...]] = {
    "A": ("situation", "chunk", "mode", "held-out", "admissible", "interval"),
    "B": ("candidate", "NFE", "mode", "chunk", "p95", "interval"),
    "C": ("candidate", "chunk", "admissible", "held-out", "stub", "mutant", "p95", "interval"),
    "D": ("candidate", "action age", "fallback", "stub", "e-value", "p95", "interval"),
    "E": (),
}


def label(name: str) -> str:
    """A field's name as a reader writes it, its unit behind a comma."""
    suffix, text = next(((s, t) for s, t in UNITS if name.endswith(s)), ("", ""))
    plain = name.removesuffix(suffix).replace("_", " ")
    return f"{plain}, {text}" if text else plain


def words(gate: Gate) -> list[tuple[str, str]]:
    """The words of a gate's page with their meanings."""
    return [(word, WORDS[word]) for word in USED[gate]]
