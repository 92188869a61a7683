"""Chunks drawn again, held against what is stated: numbers, then what only a hash is left of.

Another processor rounds otherwise. What is a number says by how much; of what was refused a journal
has the hash alone, which says something only where this machine rounds as that one did. That is
seen by the numbers of the same method; of one that has none, by those of the other methods, since
their networks run on the same kernels.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from gates.rederive_joined import Rule, hold_joined, prefixes_of
from gates.report import Gate
from gates.stated import refuse
from genpolicy.candidates.wire.policy import WirePolicy
from genpolicy.contract.chunk import actions_sha256
from genpolicy.policies.protocol import NoiseName, Policy
from genpolicy.verification.drawn import Drawn, Source
from genpolicy.verification.journal_source import readable
from genpolicy.verification.rejoined import Made

Array = NDArray[np.float64]
Invocation = tuple[NoiseName, bytes, bytes]
"""Names of the noise, what was seen, and what was gone on from."""


TOLERANCE = 1e-5
"""Of a number of a chunk, m or without unit: what another processor may make of the same sample."""
GIVEN_UP = "NaN throughout, as of a sampler that gave up, and it answers"
ANSWERED = "numbers, and it gives up"


@dataclass(frozen=True)
class Asked:
    """One candidate that is drawn again.

    Attributes:
        place: Where it stands, in words.
        source: Names of the noise, and what the policy saw.
        index: Number of the candidate.
        actions: What was drawn, where the numbers are there. Shape (K, 10).
        sha256: Its hash, where only that is.
        joined: The same as its journal states it, with what it was made of; None at Gate C.
    """

    place: str
    source: Source
    index: int
    actions: Array | None
    sha256: str = ""
    joined: Drawn | None = None

    @property
    def invocation(self) -> Invocation:
        """What is drawn together with it: the same noise, seen and gone on from."""
        return named(self.source, self.goes_on)

    @property
    def goes_on(self) -> Made | None:
        """What it was made of, where it was drawn to go on from an earlier plan."""
        made = self.joined.made if self.joined else None
        return made if made is not None and made.guided else None

    @property
    def blended_from(self) -> Mapping[str, Source]:
        """Earlier invocations that were mixed into its numbers."""
        mixed = self.joined is not None and self.joined.blended is not None
        return self.joined.earlier if self.joined is not None and mixed else {}


@dataclass(frozen=True)
class Again:
    """What a method is said to have drawn, and draws here.

    Attributes:
        gate: Whose evidence it is.
        items: What is said.
        drawn: What is drawn here for each. Shapes (N, K, 10).
        limit: What it must be, in words.
        failed: That its process failed when it was asked again; else empty.
        to_the_bit: Whether each number came again to the bit; None where there are no numbers.
    """

    gate: Gate
    items: Sequence[Asked]
    drawn: Sequence[Array]
    limit: str
    failed: str
    to_the_bit: bool | None


def draw_again(
    gate: Gate, policy: Policy, items: Sequence[Asked], *, count: int, rule: Rule
) -> Again:
    """Ask a policy again, and hold what is stated in numbers against what it answers.

    Args:
        gate: Whose evidence it is.
        policy: Who is said to have drawn them.
        items: What is said.
        count: Candidates of an invocation.
        rule: How its chunks join.

    Raises:
        RefusedError: A number lies further away than another processor explains, a chunk is of no
            candidate, one of two is no answer, or it was not joined as is said.
    """
    by_invocation = _drawn_again(policy, items, count, rule)
    drawn = [by_invocation[item.invocation] for item in items]
    limit = f"what {policy.checkpoint_hash[:16]}… draws there, within {TOLERANCE:g}"
    exact: list[bool] = []
    for item, chunks in zip(items, drawn, strict=True):
        if not 0 <= item.index < len(chunks):
            refuse(gate, item.place, "drawn", f"one of {len(chunks)} candidates")
        again = chunks[item.index]
        if item.actions is None:
            unlike = _one_is_none(item.sha256, again)
        else:
            unlike = "" if _alike(again, item.actions) else _apart(again, item.actions)
            exact.append(np.array_equal(again, item.actions, equal_nan=True))
        if unlike:
            refuse(gate, item.place, _failed(policy) or unlike, limit)
        if item.joined is not None:
            earlier = {
                name: by_invocation[named(source)] for name, source in item.blended_from.items()
            }
            hold_joined(
                gate, item.place, item.joined, own=chunks, earlier=earlier, joining=rule.joining
            )
    return Again(gate, items, drawn, limit, _failed(policy), all(exact) if exact else None)


def hold_hashes(found: Mapping[str, Again], *, networks: Sequence[str]) -> None:
    """Hold what only a hash is left of against what was drawn, where it says something.

    Args:
        found: What each method drew again, by its name.
        networks: Methods whose numbers say how this machine rounds for the others as well.

    Raises:
        RefusedError: A hash is that of another chunk.
    """
    shared = [found[name].to_the_bit for name in networks if name in found]
    rounds_alike = all(told for told in shared if told is not None)
    for again in found.values():
        own = again.to_the_bit
        if not (rounds_alike if own is None else own):
            continue
        for item, chunks in zip(again.items, again.drawn, strict=True):
            if item.actions is None and actions_sha256(chunks[item.index]) != item.sha256:
                said = again.failed or f"drawn as {item.sha256[:16]}…"
                refuse(again.gate, item.place, said, again.limit)


def _drawn_again(
    policy: Policy, items: Sequence[Asked], count: int, rule: Rule
) -> dict[Invocation, Array]:
    """What each invocation draws, and each that a blend rests on. Shapes (N, K, 10)."""
    asked: dict[Invocation, tuple[Source, Made | None]] = {}
    for item in items:
        # Candidates of one invocation are drawn together, and once.
        asked[item.invocation] = item.source, item.goes_on
        for source in item.blended_from.values():
            asked.setdefault(named(source), (source, None))
    with readable(items[0].place):
        answers = policy.sample(
            np.stack([source.history for source, _ in asked.values()]),
            noise_names=[source.key for source, _ in asked.values()],
            candidates=count,
            prefix=prefixes_of([made for _, made in asked.values()], rule),
        ).actions
    return dict(zip(asked, answers, strict=True))


def named(source: Source, goes_on: Made | None = None) -> Invocation:
    """What tells an invocation from another: its noise, what it saw and what it went on from."""
    before = b"".join(one.left.tobytes() for one in (goes_on.said if goes_on else ()))
    return source.key, source.history.tobytes(), before


def _alike(one: Array, other: Array) -> bool:
    return one.shape == other.shape and np.allclose(
        one, other, rtol=0.0, atol=TOLERANCE, equal_nan=True
    )


def _failed(policy: Policy) -> str:
    """That a process was asked again and failed, with its last words; empty where none did."""
    if not isinstance(policy, WirePolicy) or not policy.faults:
        return ""
    return f"asked again without an answer ({policy.last_words})"


def _one_is_none(sha256: str, again: Array) -> str:
    """That one of two answers is NaN throughout and the other is not; empty where both are alike.

    It needs no numbers beside the hash: of all that is NaN there is one hash.
    """
    given_up = sha256 == actions_sha256(np.full(again.shape, np.nan))
    if given_up == bool(np.isnan(again).all()):
        return ""
    return GIVEN_UP if given_up else ANSWERED


def _apart(one: Array, other: Array) -> str:
    if one.shape != other.shape:
        return f"of shape {other.shape}"
    none, due = np.isnan(other), np.isnan(one)
    if (none & ~due).any():
        return (
            GIVEN_UP
            if none.all()
            else f"NaN in {none.sum()} numbers, of which {(none & ~due).sum()} are drawn"
        )
    if (due & ~none).any():
        return ANSWERED if due.all() else f"numbers where {(due & ~none).sum()} are NaN"
    return f"up to {np.nanmax(np.abs(one - other)):.3g} beside it"
