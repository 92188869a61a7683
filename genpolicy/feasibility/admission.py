"""Admission: the only place where an `Admitted` chunk can come into being.

`Admitted` is sealed. It has no public constructor, cannot be copied, pickled, subclassed or
changed, and `verify` recognises one that was made behind the seal's back or of which anything (its
actions, what they rest on, the verdict, what they were checked against) differs from the hash that
was taken when the six layers passed.
"""

import hashlib
import weakref
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any, NoReturn

import numpy as np
from numpy.typing import NDArray

from genpolicy.contract.chunk import ChunkMetadata, Projected, Proposal, actions_sha256
from genpolicy.errors import IntegrityError
from genpolicy.feasibility.checker import LayerChecker
from genpolicy.feasibility.context import Context
from genpolicy.feasibility.reasons import Reason, Unit
from genpolicy.feasibility.verdict import LayerOutcome, Verdict

Array = NDArray[np.float64]

_SEAL = object()
PLAIN = frozenset({float, int, str, bool, type(None)})
NAMES = frozenset({LayerOutcome, Reason, Unit})
SMALL = PLAIN | NAMES


@dataclass(frozen=True)
class Rejected:
    """A chunk that a layer rejected, with everything that was known about it.

    Attributes:
        projected: Raw and projected actions.
        verdict: The six layers.
        rejected_at_s: When.
    """

    projected: Projected
    verdict: Verdict
    rejected_at_s: float

    @property
    def reason(self) -> Reason:
        """First reason."""
        found = self.verdict.first_reason
        assert found is not None, "a verdict that passed is no rejection"
        return found

    @property
    def metadata(self) -> ChunkMetadata:
        """What the chunk rests on."""
        return self.projected.metadata


class Admitted:
    """A chunk that passed all six layers; only `FeasibilityChecker` makes one.

    Attributes:
        projected: Raw and projected actions.
        actions_sha256: Hash of the projected actions when they passed.
        verdict: The six layers.
        context: What it was checked against.
        sealed: Hash of all of it when it passed.
    """

    __slots__ = ("__weakref__", "actions_sha256", "context", "projected", "sealed", "verdict")

    projected: Projected
    actions_sha256: str
    verdict: Verdict
    context: Context
    sealed: bytes

    def __init__(
        self,
        *,
        projected: Projected,
        verdict: Verdict,
        context: Context,
        seal: object = None,
        told: bytes = b"",
    ) -> None:
        if seal is not _SEAL:
            raise TypeError("Admitted is made by genpolicy.feasibility.admission only.")
        if verdict.passed is not True:
            raise TypeError("Admitted needs a verdict that passed all six layers.")
        put = object.__setattr__
        put(self, "projected", projected)
        put(self, "actions_sha256", actions_sha256(projected.actions))
        put(self, "verdict", verdict)
        put(self, "context", context)
        put(self, "sealed", _seal_of(projected, verdict, told or _hash_of(context)))
        _ISSUED.add(self)

    def __init_subclass__(cls, **kwargs: Any) -> NoReturn:
        raise TypeError("Admitted cannot be subclassed.")

    def __setattr__(self, name: str, value: object) -> NoReturn:
        raise TypeError("Admitted cannot be changed; propose a new chunk.")

    def __delattr__(self, name: str) -> NoReturn:
        raise TypeError("Admitted cannot be changed; propose a new chunk.")

    def __reduce_ex__(self, protocol: object) -> NoReturn:
        raise TypeError("Admitted cannot be copied or pickled; admit the chunk where it is used.")

    @property
    def actions(self) -> Array:
        """Projected actions, read-only. Shape (K, D_a)."""
        return self.projected.actions

    @property
    def drawn(self) -> Array:
        """Actions before projection, read-only. Shape (K, D_a)."""
        return self.projected.proposal.actions

    @property
    def metadata(self) -> ChunkMetadata:
        """What the chunk rests on."""
        return self.projected.metadata

    def verify(self) -> None:
        """Check that this object was issued here and that all of it is what passed.

        Raises:
            IntegrityError: It was not, or they are not.
        """
        if self not in _ISSUED:
            raise IntegrityError(
                where="an Admitted chunk",
                found="not issued by the feasibility module",
                expected="one that passed all six layers",
                action="Discard it and hold.",
            )
        if actions_sha256(self.projected.actions) != self.actions_sha256:
            raise IntegrityError(
                where=f"the actions of the admitted chunk {self.metadata.chunk_id}",
                found="changed since they passed",
                expected=f"sha256 {self.actions_sha256}",
                action="Discard it and hold.",
            )
        if _seal_of(self.projected, self.verdict, _hash_of(self.context)) != self.sealed:
            raise IntegrityError(
                where=f"the admitted chunk {self.metadata.chunk_id}",
                found="with other metadata, another verdict or another context than it passed with",
                expected="the ones that were sealed with its actions",
                action="Discard it and hold.",
            )


def _seal_of(projected: Projected, verdict: Verdict, told: bytes) -> bytes:
    """Hash of a chunk, its verdict, and the hash of what it was checked against."""
    return hashlib.sha256(_hash_of(projected) + _hash_of(verdict) + told).digest()


def _hash_of(whole: object) -> bytes:
    """Hash of everything below a dataclass, numbers bit for bit; asked for every action."""
    found: list[bytes] = []
    open_parts: list[Any] = [whole]
    while open_parts:
        part = open_parts.pop()
        kind = type(part)
        if kind in SMALL:
            found.append(_text(part).encode())
        elif kind is np.ndarray:
            found.append(f"{part.dtype.str}{part.shape}".encode() + part.tobytes())
        elif kind is tuple or kind is list:
            found.append(f"{len(part)} of".encode())
            open_parts += part
        elif hasattr(kind, "__dataclass_fields__"):
            found.append(kind.__name__.encode())
            _put(list(vars(part).values()), found, open_parts)
        elif kind is dict or isinstance(part, Mapping):
            keys = sorted(part)
            found.append("|".join(map(str.__repr__, keys)).encode())
            _put([part[key] for key in keys], found, open_parts)
        else:
            found.append(repr(part).encode())
    return hashlib.sha256(b"|".join(found)).digest()


def _text(value: Any) -> str:
    """A number or text as Python writes it; a name without quotes, so that no text is one."""
    return "=" + value if type(value) in NAMES else repr(value)


def _put(values: list[Any], found: list[bytes], open_parts: list[Any]) -> None:
    """Plain values at once, others one by one."""
    kinds = set(map(type, values))
    if kinds == {float}:
        found.append(b"f8" + np.array(values).tobytes())
    elif kinds <= SMALL:
        found.append("|".join(map(_text, values)).encode())
    else:
        found.append(f"{len(values)} in".encode())
        open_parts += values


_ISSUED: "weakref.WeakSet[Admitted]" = weakref.WeakSet()


class FeasibilityChecker(LayerChecker):
    """Projection, six layers, and the decision: the only maker of `Admitted`."""

    def admit(self, proposal: Proposal, *, context: Context) -> Admitted | Rejected:
        """Project, check and decide on one proposal."""
        return self.admit_many([proposal], [context])[0]

    def admit_many(
        self, proposals: Sequence[Proposal], contexts: Sequence[Context]
    ) -> list[Admitted | Rejected]:
        """Project, check and decide on many proposals, each with its own context."""
        projected = self.project_many(proposals, contexts)
        verdicts = self.check_many(projected, contexts)
        told = {i: _hash_of(c) for i, c in {id(c): c for c in contexts}.items()}
        return [
            _decide(chunk, verdict, context, told[id(context)])
            for chunk, verdict, context in zip(projected, verdicts, contexts, strict=True)
        ]

    def admit_as_it_is(self, proposal: Proposal, *, context: Context) -> Admitted | Rejected:
        """Check and decide on a proposal without repairing anything in it."""
        projected = Projected(proposal, proposal.actions, 0.0, 0.0)
        verdict = self.check(projected, context=context)
        return _decide(projected, verdict, context, _hash_of(context))


def _decide(
    projected: Projected, verdict: Verdict, context: Context, told: bytes
) -> Admitted | Rejected:
    if verdict.passed:
        return Admitted(
            projected=projected, verdict=verdict, context=context, seal=_SEAL, told=told
        )
    return Rejected(projected, verdict, context.now_s)
