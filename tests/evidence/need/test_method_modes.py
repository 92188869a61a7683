"""Which modes the samples of a method cover, and which lie between them."""

import numpy as np
import pytest
from planar import SETTINGS, admissible, planar

from genpolicy.audit.evidence import write_evidence
from genpolicy.audit.run import audit
from genpolicy.errors import ContractError
from genpolicy.evidence.need.method_modes import one_per_episode, read_situations, sample_modes


def write(data, replayed, folder, seed=3):
    folder.mkdir()
    result = audit(
        data, SETTINGS, admissible=admissible, replay=replayed.__getitem__, root_seed=seed
    )
    write_evidence(result, folder, settings=SETTINGS)
    return {path.name: path.read_bytes() for path in sorted(folder.iterdir())}


@pytest.fixture(scope="module")
def evidence(tmp_path_factory):
    data, replayed = planar(episodes=80, seed=2)
    folder = tmp_path_factory.mktemp("evidence") / "first"
    return data, replayed, folder, write(data, replayed, folder)


def test_samples_between_modes_cover_none(evidence):
    _, _, folder, _ = evidence
    situations = read_situations(folder, width=2)
    assert len(situations) >= 10
    assert len({s.episode_uuid for s in one_per_episode(situations)}) == len(
        one_per_episode(situations)
    )
    item = situations[0]
    means = np.repeat(item.mode_paths.mean(axis=0)[None], 8, axis=0)
    found = sample_modes(means, item.mode_paths, position=slice(0, 2))
    assert found.between.all() and found.modes_covered == 0 and found.modes_present == 2
    both = sample_modes(item.mode_paths, item.mode_paths, position=slice(0, 2))
    assert both.modes_covered == 2 and not both.between.any() and both.nearest.tolist() == [0, 1]
    wild = sample_modes(item.mode_paths + 5.0, item.mode_paths, position=slice(0, 2))
    assert wild.modes_covered == 0
    with pytest.raises(ContractError, match="at least two modes"):
        sample_modes(means, item.mode_paths[:1], position=slice(0, 2))
