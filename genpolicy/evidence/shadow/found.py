"""What the shadow test of a method found: rows of its tables, sessions of its journal."""

from collections import Counter
from dataclasses import dataclass, field

from genpolicy.evidence.rows.shadow import CandidateRow
from genpolicy.evidence.shadow.session import Played
from genpolicy.execution.journal import Journal
from genpolicy.execution.ledger import Account


@dataclass
class ShadowEvidence:
    """Rows of the tables, sessions of the journal.

    Attributes:
        candidates: One per candidate that was judged.
        stub: Counts of what reached the stub, by method, fixture and name.
        accounts: Balances of the sessions, by method and fixture.
        sessions: Their journals.
    """

    candidates: list[CandidateRow] = field(default_factory=list)
    stub: Counter[tuple[str, str, str]] = field(default_factory=Counter)
    accounts: dict[tuple[str, str], list[Account]] = field(default_factory=dict)
    sessions: list[Journal] = field(default_factory=list)

    def keep(self, played: Played, method: str, fixture: str) -> None:
        """Take a session in."""
        for name in ("arrivals", "stale", "invalid", "delivered"):
            self.stub[(method, fixture, name)] += getattr(played, name)
        self.accounts.setdefault((method, fixture), []).append(played.account)
        self.sessions.append(played.journal)
