"""How the chunks of one rollout join: the rule, what it remembers, and what goes on record."""

import numpy as np

from genpolicy.candidates.joining import BIDIRECTIONAL, BLENDS, DRAWN_ON, REPLACE
from genpolicy.candidates.votes import (
    VOTE_CHECKS,
    Now,
    Past,
    Prediction,
    VoteCheck,
    Votes,
    join,
    prefix,
    rest_of_plan,
)
from genpolicy.contract.chunk import Candidate, ChunkMetadata, Proposal
from genpolicy.evidence.stress.state import InFlight, Setup
from genpolicy.execution.journal import Journal
from genpolicy.execution.nanoseconds import to_ns
from genpolicy.feasibility.admission import Admitted


class Joined:
    """The rule of one rollout, and the predictions that it remembers.

    Args:
        setup: What the rollout shares with the others; the rule among it.
        journal: Of the rollout.
        checks: Who has a vote; a part of the table only for the evidence on mutants.
    """

    def __init__(
        self,
        setup: Setup,
        journal: Journal,
        *,
        checks: tuple[VoteCheck, ...] = VOTE_CHECKS,
    ) -> None:
        self._setup, self._journal = setup, journal
        self._joining = setup.joining
        self._past = Past(checks)

    def begin(self, flying: InFlight) -> None:
        """What an invocation that begins now is to go on from; only `DRAWN_ON` say it before."""
        if self._joining.rule not in DRAWN_ON:
            return
        flying.votes = self._votes(flying.metadata, first=0)[-1:]
        rows = self._setup.horizons.prediction_horizon
        if self._joining.starts_at is not None:
            flying.prefix = rest_of_plan(flying.votes, rows=rows)
        else:
            frozen = self._setup.execution.replan_lead_rows
            flying.prefix = prefix(flying.votes, rows=rows, frozen=frozen)

    def propose(self, flying: InFlight, drawn: list[Candidate], *, late_rows: int) -> Proposal:
        """What is proposed of an answer, when its turn is `flying.candidate`."""
        rule, turn = self._joining.rule, flying.candidate
        # What orders the candidates stays what it was at the first of them.
        if rule in BLENDS or (rule == BIDIRECTIONAL and turn == 0):
            votes = self._votes(flying.metadata, first=late_rows)
            flying.votes = votes[-1:] if rule == BIDIRECTIONAL else votes
        proposal = join(drawn, turn, flying.votes, self._joining)
        flying.draw = proposal.metadata.candidate_index
        return proposal

    def record(self, flying: InFlight, chunk_id: str, now_s: float) -> None:
        """Put on record what a candidate was made of, before its verdict."""
        if self._joining.rule == REPLACE:
            return
        payload = {
            "chunk_id": chunk_id, "invocation": flying.metadata.chunk_id,
            "rule": self._joining.rule, "draw": flying.draw,
            "parents": {vote.before.invocation: [vote.first, vote.stop] for vote in flying.votes},
        }  # fmt: skip
        self._journal.add("joined", self._journal.clock(now_s), payload)

    def entered(self, flying: InFlight, admitted: Admitted) -> None:
        """A chunk has entered the queue: from now on it is what others join."""
        if self._joining.rule == REPLACE or flying.chunks is None:
            return
        drawn = np.array(flying.chunks[flying.draw])
        own = Prediction(flying.metadata.chunk_id, admitted.metadata, drawn, admitted.actions)
        self._past.note(own)

    def _votes(self, metadata: ChunkMetadata, *, first: int) -> list[Votes]:
        age_s = self._setup.execution.maximum_age_s[metadata.task_phase]
        now = Now(
            metadata=metadata,
            execution_horizon=self._setup.horizons.execution_horizon,
            maximum_age_ns=to_ns(age_s),
        )
        return self._past.votes(now, first=first)
