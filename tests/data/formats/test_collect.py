"""From recordings to a dataset: each episode accepted or refused, a bad contract before reading."""

from dataclasses import dataclass, field

import numpy as np
import pytest

from genpolicy.data.assemble import Refusal
from genpolicy.data.contract import SplitRule
from genpolicy.data.dataset import load_dataset
from genpolicy.data.formats.collect import import_source
from genpolicy.data.formats.contract import contract_of
from genpolicy.data.formats.source import Column, RawEpisode
from genpolicy.errors import ConfigError, ContractError

COLUMNS = (Column("state", 2), Column("action", 2), Column("phase", None, "text"))


def episode(number, **changes):
    path = np.random.default_rng(number).normal(0, 0.01, (12, 2)).cumsum(axis=0)
    columns = {"state": path, "action": path + 0.001, **changes}
    return RawEpisode(f"demo_{number}", "0" * 64, columns)


@dataclass
class Recordings:
    """A source that hands over what it is given and counts how often it is read."""

    handed: list
    columns: tuple = COLUMNS
    name: str = "recordings"
    notes: tuple = ("a note of the source",)
    reads: list = field(default_factory=list)

    @property
    def count(self):
        return len(self.handed)

    def episodes(self, wanted, episode=None, also=None):
        self.reads.append(tuple(wanted))
        yield from self.handed


def contract(state="state[0:2]", **labels):
    components = ["x", "y"] if state.endswith("]") else ["x"]
    return contract_of({
        "format": "parquet", "task": "push", "rate_hz": 10.0,
        "channels": [{"name": "hand_m", "columns": [state], "components": components,
                      "unit": "m", "stream": "state"}],
        "action": {"columns": ["action[0:2]"], "components": ["x", "y"], "units": ["m", "m"]},
        "labels": labels,
    }, where="here")  # fmt: skip


def imported(source, tmp_path, rules=None, **options):
    return import_source(
        source, rules or contract(), out=tmp_path / "out", split=SplitRule(), **options
    )


def test_every_episode_is_accepted_or_refused_and_told(tmp_path):
    told = []
    source = Recordings([
        *(episode(n) for n in range(6)),
        Refusal("demo_6", "its file", "cut off"),
        episode(7, action=np.full((12, 2), np.nan)),
        episode(2),
    ])  # fmt: skip
    opened = imported(source, tmp_path, progress=lambda done, of: told.append((done, of)))
    assert (opened.found, opened.accepted) == (9, 6)
    assert [refusal.file for refusal in opened.refused] == ["demo_6", "demo_7", "demo_2"]
    assert "samples of demo_2 again" in opened.refused[2].reason
    assert told == [(n, 9) for n in range(1, 10)]
    assert "a note of the source" in opened.notes
    assert len(load_dataset(opened.folder).episodes) == 6


@pytest.mark.parametrize(
    ("state", "labels", "said"),
    [
        ("pose[0:2]", {}, "pose.*not in recordings"),
        ("phase", {}, "phase.*not numbers per row"),
        ("state", {}, r"state.*name\[i\]"),
        ("state[1:3]", {}, "state.*2 numbers wide"),
        ("state[0:2]", {"task": "goal"}, "goal.*label task"),
    ],
)
def test_a_contract_that_does_not_fit_is_refused_before_anything_is_read(
    tmp_path, state, labels, said
):
    source = Recordings([episode(n) for n in range(6)])
    with pytest.raises(ConfigError, match=said):
        imported(source, tmp_path, contract(state, **labels))
    assert source.reads == [] and not (tmp_path / "out").exists()


def test_nothing_accepted_leaves_nothing(tmp_path):
    with pytest.raises(ContractError):
        imported(Recordings([Refusal("demo_0", "its file", "cut off")]), tmp_path)
    assert not (tmp_path / "out").exists()
