"""Network evaluations of one sampling run, with what no value is needed for computed ahead.

Condition and time of an evaluation are known before the first of them; only the chunk is not. So
what the trunk makes of them is computed for many times in one product, once for all candidates of
an observation, in place of once for every candidate at every step. Rows are the same rows: no bit
of a sample depends on it.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from operator import itemgetter

import torch
from torch import Tensor

from genpolicy.policies.networks import PolicyNetwork, Prepared, apart, joined

# (what was prepared, values (B, ...)) -> the rest of an evaluation (B, ...)
Finish = Callable[[Prepared, Tensor], Tensor]

# Times prepared together; bounds the memory that a sampler of many steps takes.
TIMES_AHEAD = 32


@dataclass(frozen=True)
class Conditions:
    """Conditions of the rows of a batch, each stored once.

    Attributes:
        stored: Shape (U, C).
        of_row: Which of them a row has. Shape (B,).
    """

    stored: Tensor
    of_row: Tensor

    @property
    def rows(self) -> Tensor:
        """The condition of every row. Shape (B, C)."""
        return self.stored[self.of_row]

    def zeros(self, size: int) -> Tensor:
        """So many zeros for every row. Shape (B, size)."""
        return self.stored.new_zeros(len(self.of_row), size)

    def spread(self, values: Tensor) -> Tensor:
        """Of values (U, ...) the one of each row: one for all rows where all have the same."""
        return values if len(self.stored) == 1 else values[self.of_row]


class AheadNetwork:
    """A network at the conditions of a batch; a `samplers.NetworkFunction`.

    A time that was not announced is evaluated as it comes, so that no sample depends on what was.
    """

    def __init__(
        self,
        network: PolicyNetwork,
        conditions: Conditions,
        *,
        times: Sequence[float],
        call_rows: Callable[[int], int],
        finish: Finish | None = None,
    ) -> None:
        """A network for one run of a sampler.

        Args:
            network: Trained network.
            conditions: Of the rows of the batch.
            times: Times that the sampler will ask for, as float32 holds them, in its order.
            call_rows: Rows that a network call for so many rows has, padded.
            finish: The rest of an evaluation, where it is another one than the network's.
        """
        self._network = network
        self._finish = finish or network.finish
        self._conditions = conditions
        self._call_rows = call_rows
        self._times = list(dict.fromkeys(times))
        self._place = {time: place for place, time in enumerate(self._times)}
        self._block, self._prepared = -1, list[Prepared]()
        self.unannounced = 0

    def __call__(self, values: Tensor, time: Tensor) -> Tensor:
        """One evaluation of values (B, ...) at times (B,), equal ones where they were announced."""
        place = self._place.get(float(time[0]))
        if place is None:
            self.unannounced += 1
            return self._whole(values, time)
        block, within = divmod(place, TIMES_AHEAD)
        if self._block != block:
            self._prepare(block)
        return self._finish(self._prepared[within].rows(self._conditions.spread), values)

    def _whole(self, values: Tensor, time: Tensor) -> Tensor:
        """An evaluation with nothing computed ahead, in a call of the network's own size."""
        count, size = len(values), self._call_rows(len(values))
        rows = (self._conditions.rows, values, time)
        return self._network.evaluate(*(padded(own, size) for own in rows))[:count]

    def _prepare(self, block: int) -> None:
        """Every stored condition at every time of a block, time after time."""
        stored = self._conditions.stored
        times = self._times[block * TIMES_AHEAD : (block + 1) * TIMES_AHEAD]
        every = stored.repeat(len(times), 1)
        at = stored.new_tensor(times).repeat_interleave(len(stored))
        parts, most = [], self._call_rows(len(every))
        for condition, time in zip(torch.split(every, most), torch.split(at, most), strict=True):
            size = self._call_rows(len(condition))
            part = self._network.prepare(padded(condition, size), padded(time, size))
            parts.append(part.rows(itemgetter(slice(len(condition)))))
        self._block, self._prepared = block, apart(joined(parts), len(stored))


def padded(rows: Tensor, size: int) -> Tensor:
    """`rows` (n, ...) followed by copies of its last row, up to `size` rows."""
    missing = size - len(rows)
    return torch.cat([rows, rows[-1:].expand(missing, *rows.shape[1:])]) if missing else rows
