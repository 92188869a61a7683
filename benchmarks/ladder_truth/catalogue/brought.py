"""Wrongs of a policy that somebody brings: each serves the weights that the ladder trained.

All are brought to one workspace, where each is one candidate more: what stops one of them stops no
other, and who fails a gate stands in no evidence above it.
"""

from benchmarks.ladder_truth.bringing import TOGETHER, Brings
from benchmarks.ladder_truth.outcome import Expected
from benchmarks.ladder_truth.planting import Wrong

AREA = "brought policies"
B, C, D = "B", "C", "D"


def _wrong(name: str, what: str, served: str, gate: str, criteria: tuple[str, ...],
           said: str = "") -> Wrong:  # fmt: skip
    expected = Expected(gate, criteria, candidate=name, said=said)
    return Wrong(name, AREA, what, "small", Brings(name, served), expected, together=TOGETHER)


WRONGS = (
    _wrong("answers_late", "Each answer comes 0.4 s after its question; the deadline is 0.15 s.",
           "late", D, ("deadline_miss_upper",)),
    _wrong("peeks_at_a_global_seed",
           "Its noise comes from a global generator, seeded at its start, not from the name.",
           "global_seed", B, ("samples_difference",)),
    _wrong("other_weights_behind_gate_b",
           "Once the report of gate B names it, it answers with other weights; no file changes.",
           "other_weights_behind_b", C, ("changed_answers",)),
    _wrong("other_weights_behind_gate_c", "The same behind gate C.",
           "other_weights_behind_c", D, ("changed_answers",)),
    _wrong("returns_the_recorded_future",
           "It answers with what was done next where the recordings were most alike.",
           "recorded_future", B, ("conformance",), r"own_answers"),
    _wrong("ignores_the_observation", "It is shown one and the same observation, always.",
           "blind", B, ("conformance",), r"follows_observation"),
    _wrong("spread_off_by_ten",
           "Its actions come back to units by a standard deviation ten times too large.",
           "wrong_spread", B, ("conformance",), r"scale"),
    _wrong("left_and_right_swapped", "The sideways axis of its actions has the other sign.",
           "swapped", B, ("conformance",), r"scale"),
    _wrong("millimetres_for_metres", "Its places are in mm, and its entry says m.",
           "millimetres", B, ("conformance",), r"scale"),
)  # fmt: skip
