"""The whole gate, trial by trial: blocks change nothing but why who could never pass does not."""

from pathlib import Path

import pytest

from benchmarks.decision.__main__ import of_world, planned, replace_alpha
from benchmarks.decision.whole import judged
from benchmarks.decision.worlds import World, draw
from genpolicy.evidence.stress.power import power_document
from genpolicy.seeds import stream

ROOT = Path(__file__).parents[3]
GAINS = (-0.3, 0.0, 0.05, 0.15, 0.3)
TRIALS = 3


@pytest.fixture(scope="module")
def shipped():
    return planned(ROOT)


@pytest.mark.parametrize("gain", GAINS)
def test_the_whole_gate_says_in_blocks_what_it_says_of_all_starts(shipped, gain):
    settings, limits, section = shipped
    world = World("w", "", ("promoted",), (0.5, 0.2), (0.5 + gain, 0.5 + gain / 3, 0.8))
    own = of_world(settings, world)
    power = power_document(replace_alpha(section, own), candidates=3, root_seed=1)
    stopped = 0
    for number in range(TRIALS):
        key = (11, "whole blocks", f"{gain:g}", number)
        drawn = draw(world, own.planned_starts, stream(*key))
        reports = [
            judged(
                drawn,
                own.model_copy(update={"block": block}).under(limits),
                limits,
                vars(power) | {"rows": [vars(row) for row in power.rows]},
                stream(*key, "costs"),
            )
            for block in (None, 15)
        ]
        whole, blocks = reports
        assert blocks.promoted == whole.promoted
        for name, verdict in whole.candidates.items():
            if blocks.candidates[name] == verdict:
                continue
            assert (verdict, blocks.candidates[name]) == ("INCONCLUSIVE", "FAIL")
        told = {text.split(" ")[0] for text in blocks.caveats if " was stopped: " in text}
        assert all(blocks.candidates[name] == "FAIL" for name in told)
        assert all(whole.candidates[name] != "PASS" for name in told)
        found = {(answer.id, answer.candidate): answer for answer in blocks.criteria}
        for answer in whole.criteria:
            if answer.candidate not in told:
                own_said = found[answer.id, answer.candidate]
                assert own_said.model_copy(update={"evidence": answer.evidence}) == answer
        stopped += len(told)
    assert stopped >= (TRIALS if gain <= 0.0 else 0)
