"""An executor whose arm a person may have: called, come, gone again.

While a person has it the task's classical plan drives, as that person's; the policy's chunks are
discarded. Nothing is passed by: what the person drives comes by `deliver_fallback`, through the
same queue, checks, stub and supervisor, and no stop is cleared.
"""

from genpolicy.contract.names import says
from genpolicy.execution.executor import Executor
from genpolicy.execution.ledger import Conservation
from genpolicy.execution.moment import ExecutorMode
from genpolicy.execution.observed import name_of


class AttendedExecutor(Executor):
    """An executor with somebody who may come.

    Attributes:
        person: Who has the arm and drives it; empty if nobody does.
    """

    person: str = ""

    def take_over(self, now_s: float, person: str) -> bool:
        """Who was called by `intervene` has the arm now, unless a stop stands: that stays.

        Returns:
            Whether the person has it.
        """
        now_ns = self._begin(now_s)
        called = self.mode is ExecutorMode.INTERVENTION
        if not called or self.stub.supervisor.stopped or not says(name_of(person)):
            return False
        self.person = name_of(person)
        self._journal.add("person", now_ns, {"stage": "took_over", "who": self.person})
        self._enter(now_ns, ExecutorMode.FALLBACK)
        return True

    def intervene(self, now_s: float) -> None:
        """As of an executor; who had the arm has given up."""
        self._leave(now_s, "gave_up")
        super().intervene(now_s)

    def hand_back(self, now_s: float) -> None:
        """As of an executor, also from who drives; the arm holds until the policy has looked."""
        if self.person:
            self._leave(now_s, "handed_back")
            super().intervene(now_s)
        super().hand_back(now_s)

    def end_fallback(self, now_s: float) -> None:
        """As of an executor; a person is no fallback that could be ended."""
        if not self.person:
            super().end_fallback(now_s)

    def reset(self, now_s: float) -> None:
        """As of an executor; who drove must take over again, and until then the arm holds."""
        if self.person:
            self.intervene(now_s)
        super().reset(now_s)

    def end_episode(self, now_s: float) -> Conservation:
        """As of an executor."""
        self._leave(now_s, "episode_over")
        return super().end_episode(now_s)

    def _leave(self, now_s: float, stage: str) -> None:
        if self.person:
            payload = {"stage": stage, "who": self.person}
            self._journal.add("person", self._begin(now_s), payload)
            self.person = ""
