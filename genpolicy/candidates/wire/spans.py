"""Where the time of an invocation goes: all of it once, each part to the term that it is of.

A server may measure any of the eleven terms. Those of its owner, the model, are its own. The others
are measured or declared elsewhere, for everybody alike, and come on top by both clocks: sensors,
network and queue of the cell, and the check of a chunk, which is charged again for every further
candidate. So what a server states of them is a part of its answer that is none of theirs: it is
sampling, as is all that nobody explains, the wire and the writing of messages among it.
"""

from collections.abc import Mapping

import numpy as np

from genpolicy.contract.latency import OWNERS, Owner, Term

OWN_TERMS = tuple(term for term in Term if OWNERS[term] is Owner.MODEL)
"""What a policy's server answers for."""
EXPECTED_TERMS = (Term.PREPROCESS, Term.ENCODE, Term.SAMPLE)
"""Unknown, not zero, where it does not measure them. Selecting is measured here too."""


def terms_of(spans_s: Mapping[str, float], seconds: float) -> dict[Term, float]:
    """What the terms of one answer took, s; together as long as the answer, or as they state.

    Args:
        spans_s: What the server states, by the names of terms, s.
        seconds: From the first byte sent to the last chunk mapped.

    Returns:
        NaN of an expected term that was not measured. `select` only where it is stated: it is to
        be added to what selecting takes here.
    """
    stated = {term: spans_s[str(term)] for term in OWN_TERMS if str(term) in spans_s}
    rest_s = max(0.0, seconds - sum(stated.values()))
    return {
        **dict.fromkeys(EXPECTED_TERMS, np.nan),
        **stated,
        Term.SAMPLE: stated.get(Term.SAMPLE, 0.0) + rest_s,
    }


def of_others_s(spans_s: Mapping[str, float]) -> dict[str, float]:
    """What a server states of terms that are not its own, s, and that counts as sampling."""
    return {name: span for name, span in spans_s.items() if name not in OWN_TERMS}
