"""A plain server that draws, asked as stage `reload` asks: Gate B says why it does not reproduce.

No extension, no hash, no name of the noise: what any client of openpi is served with.
"""

from dataclasses import asdict

import evidence
import pytest

from gates.proof import judge
from genpolicy.candidates.conformance.recorded_starts import recorded_starts
from tests.candidates.conformance.test_check import Honest
from tests.candidates.conftest import entry_of, serving  # noqa: F401
from tests.evidence.reproducibility.test_brought import answered, asking  # noqa: F401
from tests.gates.reproducibility.test_brought import EXCEPTION, bring, of_flow

COMPARED = ["sha256_trained", "sha256_reloaded", "max_abs_difference"]


class Plain(Honest):
    """Speaks nothing but openpi's words; it draws anew at each question, or always the same."""

    draws = True

    def __init__(self, starts):
        super().__init__(starts, plain=True)

    def __call__(self, message):
        self.asked += 1
        row = self.rows.get(message["observation"].tobytes(), 0)
        return {"actions": self.chunk(row, (self.asked if self.draws else 0,))}


class PlainAndFixed(Plain):
    draws = False


@pytest.fixture
def judged(ladder, answered, asking):  # noqa: F811
    """Gate B's report of what a plain server answered, in the place of the synthetic `flow`."""

    def judge_of(kind):
        starts = recorded_starts(asking.data, asking.deployment.horizons, seed=asking.root_seed)
        found = answered(kind(starts), {})
        said = asdict(found.conformance)
        findings = said.pop("findings")
        bring(ladder, unmatched=EXCEPTION, findings=findings, told=said)
        rows = {row.row: row for row in found.samples}

        def compared(frame):
            for at in frame.index[frame["method"] == "flow"]:
                frame.loc[at, COMPARED] = [
                    getattr(rows[frame.loc[at, "row"]], name) for name in COMPARED
                ]
            return frame

        evidence.edit_table(ladder, "reload/samples.parquet", compared)
        return judge(ladder, "B")

    return judge_of


def test_a_plain_server_that_draws_fails_since_it_cannot_be_seeded(judged):
    report = judged(Plain)
    assert report.candidates == {"diffusion": "PASS", "flow": "FAIL"}
    answer = of_flow(report, "conformance")
    assert answer.verdict == "FAIL"
    named = "seeded: its chunks differ from draw to draw; it takes no name of the noise"
    assert named in answer.caveat
    assert "repeats: " in answer.caveat.partition("; holds")[0]
    again = of_flow(report, "samples_difference")
    assert again.verdict == "FAIL" and 0.0 < again.measured < 0.1
    assert "not bit-equal" in again.caveat


def test_a_plain_server_that_always_draws_the_same_reproduces(judged):
    report = judged(PlainAndFixed)
    answer = of_flow(report, "conformance")
    assert "seeded: its chunks differ" not in answer.caveat
    assert of_flow(report, "samples_difference").verdict == "PASS"
