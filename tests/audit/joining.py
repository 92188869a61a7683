"""Episodes joined to others, and the kinds of findings of data."""

import numpy as np
from arms import SETTINGS, build, parts, rebuilt

from genpolicy.audit.semantics import measure
from genpolicy.seeds import stream


def kinds(data):
    return [finding.kind for finding in measure(data, SETTINGS).findings]


def joined(data, chosen, other):
    commands, seen = parts(data)
    rows = list(zip(commands, seen, strict=True))
    for k in np.flatnonzero(chosen):
        second = other(k) % len(rows)
        commands[k] = np.vstack([rows[k][0], rows[second][0]])
        seen[k] = np.vstack([rows[k][1], rows[second][1]])
    return rebuilt(data, commands, seen)


def copied(data, share, *, late=0, keep=1.0, noise=0.0):
    """A share of the episodes appended again: begun later, cut, with noise."""
    commands, seen = parts(data)
    rng = stream(9, "copied")
    for k in rng.choice(len(commands), round(share * len(commands)), replace=False):
        last = late + int(keep * (len(commands[k]) - late))
        commands.append(commands[k][late:last])
        copy = seen[k][late:last]
        seen.append(copy + noise * rng.normal(size=copy.shape))
    return build(commands, seen, epochs=2, period_s=data.period_s)
