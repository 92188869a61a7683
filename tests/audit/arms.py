"""Arms of any kind for the tests of data semantics: random smooth motion, plant with lag, noise.

The unit, the rate, the number of joints, the noise and the lag are arguments; a fault is planted by
the tests on what comes out.
"""

from dataclasses import replace

import numpy as np
from scipy.signal import lfilter

from genpolicy.audit.data import AuditInput, Episodes, canonical
from genpolicy.audit.settings import AuditSettings
from genpolicy.seeds import stream

SETTINGS = AuditSettings(
    position_channel="arm", reference_channel=None, context_channels=[], ignored_channels=[]
)


def arms(
    seed, *, episodes=60, rate_hz=20.0, width=3, unit=1.0, noise=2e-3, lag_s=0.12, epochs=2,
    rows=(50, 90),
):  # fmt: skip
    """Episodes through three random places each; lengths are `unit` times a third of a metre."""
    rng = stream(seed, "arms")
    period = 1.0 / rate_hz
    speeds = rng.uniform(0.7, 1.3, 3)
    constant = lag_s * rng.uniform(0.3, 0.6)
    commands, seen, number, index = [], [], [], []
    for episode in range(episodes):
        n = int(rng.integers(*rows))
        places = 0.3 * np.array([np.linspace(0, 1, 4)] * width).T * np.sign(rng.normal(size=width))
        places = places + 0.1 * rng.normal(size=(4, width))
        fine = 20
        at = np.clip(np.linspace(-0.1, 1.1 * speeds[episode % 3], n * fine), 0, 1) * 3
        part = np.minimum(at.astype(int), 2)
        s = at - part
        smooth = (10 * s**3 - 15 * s**4 + 6 * s**5)[:, None]
        path = places[part] + smooth * (places[part + 1] - places[part])
        late = round((lag_s - constant) / period * fine)
        delayed = np.vstack([np.repeat(path[:1], late, axis=0), path])[: len(path)]
        share = 1 - np.exp(-period / fine / constant)
        rest = delayed[0]
        response = rest + lfilter([share], [1.0, share - 1.0], delayed - rest, axis=0)
        tremor = 0.3 * noise * rng.normal(size=(n, width))
        commands.append(unit * (path[::fine] + tremor))
        seen.append(unit * (response[::fine] + 0.3 * noise * rng.normal(size=(n, width))))
        number += [episode] * n
        index += list(range(n))
    return build(commands, seen, epochs=epochs, period_s=period)


def build(commands, seen, *, epochs, period_s):
    count = len(commands)
    width = commands[0].shape[1]
    lengths = [len(part) for part in commands]
    index = np.concatenate([np.arange(n) for n in lengths])
    table = Episodes(
        uuid=np.array([f"ep{k:04d}" for k in range(count)]),
        split=np.array((["train"] * 3 + ["validation", "test"]) * (count // 5 + 1))[:count],
        operator=np.full(count, ""), object=np.full(count, ""),
        calibration_epoch=np.array([f"e{k * epochs // count}" for k in range(count)]),
        outcome=np.full(count, "success"), is_recovery=np.zeros(count, dtype=bool),
        order=np.arange(count, dtype=float),
    )  # fmt: skip
    return canonical(AuditInput(
        observation=np.vstack(seen), action=np.vstack(commands),
        phase=np.full(len(index), "any"), episode=np.repeat(np.arange(count), lengths),
        index=index, event_time_s=period_s * index, episodes=table,
        observation_scale=np.full(width, 0.01),
        observation_names=tuple(f"j{k}" for k in range(width)),
        observation_position=slice(0, width), action_position=slice(0, width),
        period_s=period_s, streams={"robot": slice(0, width)},
    ))  # fmt: skip


def parts(data):
    """Commands and observations, episode by episode."""
    edges = np.searchsorted(data.episode, np.arange(1, len(data.episodes)))
    return np.split(data.action, edges), np.split(data.observation, edges)


def rebuilt(data, commands, seen):
    """The data with other rows, the strata unchanged."""
    epochs = len(np.unique(data.episodes.calibration_epoch))
    return build(commands, seen, epochs=epochs, period_s=data.period_s)


def late(data, steps, chosen):
    """The observed position of some episodes comes later by `steps` rows (a number, or a ramp)."""
    commands, seen = parts(data)
    for k in np.flatnonzero(chosen):
        n = len(seen[k])
        shift = steps(n) if callable(steps) else np.full(n, float(steps))
        at = np.clip(np.arange(n) - shift, 0, n - 1)
        seen[k] = np.stack([np.interp(at, np.arange(n), c) for c in seen[k].T], axis=1)
    return rebuilt(data, commands, seen)


def last_epoch(data):
    return data.episodes.calibration_epoch == data.episodes.calibration_epoch[-1]


def some(data, share, seed=0):
    return stream(seed, "some").random(len(data.episodes)) < share


def with_columns(data, **columns):
    return replace(data, **columns)
