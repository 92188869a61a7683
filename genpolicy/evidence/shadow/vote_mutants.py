"""Mutants of the table of votes: a blend that rests on what had run out must be found.

As in `mutants`, each scenario is played with the whole table, and then the independent checker
must find nothing, and with the tuple minus one row, and then it must find that a prediction voted
which could no longer be executed itself (`P6.vote`).
"""

from collections.abc import Callable

from genpolicy.candidates.joining import JoiningSettings
from genpolicy.candidates.votes import VOTE_CHECKS, Now, Past, Prediction, VoteCheck, join
from genpolicy.contract.chunk import Candidate
from genpolicy.evidence.documents.shadow import ExecutionMutant
from genpolicy.evidence.shadow.mutants import row_of, rules_of, violations_in
from genpolicy.evidence.shadow.rig import EXECUTION as EXECUTION_OF_RIG
from genpolicy.evidence.shadow.rig import ROWS, Rig, StandIn, passing_verdict
from genpolicy.execution.checks import without
from genpolicy.verification.joined import LABEL
from genpolicy.verification.report import Violation

PREFIX = "vote_"
JOINING = JoiningSettings(rule="ensemble_oldest")
PERIODS = 2
"""Between two invocations of a scenario."""
MAXIMUM_AGE_S = 0.3
"""One row less than the horizon reaches, so that each of the two has a row of its own to refuse."""


class Voting:
    """A rig whose chunks are blends of what it delivered before.

    Args:
        checks: The table of votes.
        session: Name of the session.
    """

    def __init__(self, checks: tuple[VoteCheck, ...], session: str) -> None:
        ages_s = dict.fromkeys(EXECUTION_OF_RIG.force_limit_n, MAXIMUM_AGE_S)
        labels = {LABEL: JOINING.rule}
        self.rig = Rig(session=session, labels=labels, maximum_age_s=ages_s)
        self.past = Past(checks)

    def chunk(self, **changes: object) -> None:
        """An invocation: observe, blend, put it on record, deliver, and execute the first rows."""
        rig = self.rig
        rig.observe()
        drawn = rig.chunk(**changes)
        votes = self.past.votes(self._now(drawn), first=0)
        proposal = join([Candidate(drawn.metadata, drawn.actions)], 0, votes, JOINING)
        chunk_id = proposal.metadata.chunk_id
        rig.journal.add("joined", rig.now_ns, {
            "chunk_id": chunk_id, "invocation": drawn.metadata.chunk_id, "rule": JOINING.rule,
            "draw": 0,
            "parents": {vote.before.invocation: [vote.first, vote.stop] for vote in votes},
        })  # fmt: skip
        rig.journal.candidate(
            rig.now_s, chunk_id=chunk_id, method="rig", index=0, first_reason=None,
            layers={layer.name: layer.passed for layer in drawn.verdict.layers},
        )  # fmt: skip
        whole = rig.remade(drawn, proposal.metadata, proposal.actions)
        if rig.deliver(whole) is None:
            own = Prediction(
                drawn.metadata.chunk_id, proposal.metadata, drawn.actions, whole.actions
            )
            self.past.note(own)
        rig.tick(PERIODS)

    def _now(self, drawn: StandIn) -> Now:
        cell = self.rig.cell
        return Now(
            metadata=drawn.metadata,
            execution_horizon=cell.horizons.execution_horizon,
            maximum_age_ns=cell.maximum_age_ns[drawn.metadata.task_phase],
        )


def _again(voting: Voting) -> None:
    voting.chunk()
    voting.chunk()


def _broken_chain(voting: Voting) -> None:
    voting.chunk()
    voting.chunk(predecessor_chunk_id="")


def _planned_ahead(voting: Voting) -> None:
    """Its observation is as young as its chunk is late: the horizon ends before it is too old."""
    rows = (3, ROWS)
    voting.chunk(action_start_time_s=-0.15, verdict=passing_verdict(rows=rows))
    voting.chunk()


def _short_validity(voting: Voting) -> None:
    voting.chunk(valid_until_s=voting.rig.now_s + 0.11)
    voting.chunk()


SCENARIOS: dict[str, Callable[[Voting], None]] = {
    "chain": _broken_chain,
    "horizon": _planned_ahead,
    "valid": _short_validity,
    "age": _again,
}


def vote_mutants() -> list[ExecutionMutant]:
    """Play every scenario with and without its check; one row per row of `VOTE_CHECKS`."""
    found = []
    for check in VOTE_CHECKS:
        unchanged = play(check.name, VOTE_CHECKS)
        mutant = play(check.name, without(VOTE_CHECKS, check.name))
        found.append(row_of(f"{PREFIX}{check.name}", rules_of(mutant), rules_of(unchanged)))
    return found


def play(name: str, checks: tuple[VoteCheck, ...]) -> list[Violation]:
    """Violations that the checker finds in the scenario of a check, declarations aside."""
    voting = Voting(checks, f"{PREFIX}{name}")
    SCENARIOS[name](voting)
    voting.rig.executor.end_episode(voting.rig.now_s)
    return violations_in(voting.rig)
