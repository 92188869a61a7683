"""Evidence files: exact columns, same bytes, no dependence on the order of episodes."""

from dataclasses import replace

import numpy as np
import pytest
from planar import LIMITS, SETTINGS, admissible, planar, shuffled

from gates.cause import cause_of
from genpolicy.audit.evidence import write_evidence
from genpolicy.audit.run import audit
from genpolicy.errors import ContractError
from genpolicy.evidence.need.method_modes import one_per_episode, read_situations, sample_modes
from genpolicy.integrity.tables import read_table

FILES = {
    "clocks.parquet", "calibration.parquet", "components.parquet", "neighbourhoods.parquet",
    "modes.parquet",
    "strata.parquet", "replay.parquet", "recovery.parquet", "persistence.json", "summary.json",
    "settings.json", "findings.parquet", "resamples.parquet", "examples.parquet",
    "alignment.parquet", "support.parquet", "demonstrated.parquet",
    "predictions.parquet", "asked.parquet", "reach.parquet", "structure_draws.parquet",
    "finding_draws.parquet", "sides.parquet", "alternatives.parquet", "tremor.parquet",
}  # fmt: skip


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


def test_same_bytes_again_and_for_any_order_of_episodes(evidence, tmp_path):
    data, replayed, _, first = evidence
    assert set(first) == FILES
    np.random.seed(5)
    assert write(data, replayed, tmp_path / "again") == first
    assert write(shuffled(data, 7), replayed, tmp_path / "shuffled") == first


def test_another_seed_changes_draws_but_not_the_cause(evidence, tmp_path):
    data, replayed, folder, first = evidence
    other = write(data, replayed, tmp_path / "other", seed=4)
    assert other != first
    causes = [cause_of(place, LIMITS) for place in (folder, tmp_path / "other")]
    assert causes[0].name == causes[1].name


def test_tables_have_the_columns_that_the_gate_reads(evidence):
    _, _, folder, _ = evidence
    table = read_table(folder / "neighbourhoods.parquet")
    assert table.column_names == [
        "split", "phase", "episode_uuid", "index", "neighbours", "clusters", "cluster_sizes",
        "two_mode", "separation_m", "mean_admissible", "mean_reason", "median_admissible",
        "modes_admissible", "mean_path", "mode_paths", "persistent", "component",
    ]  # fmt: skip
    rows = table.to_pylist()
    assert all(sum(row["cluster_sizes"]) == row["neighbours"] + 1 for row in rows)
    assert all(len(row["mode_paths"]) == row["clusters"] for row in rows)
    for name in ("mean_admissible", "median_admissible"):
        assert all((row[name] is None) == (not row["two_mode"]) for row in rows)
    followed = read_table(folder / "demonstrated.parquet").to_pylist()
    assert {row["mode"] for row in followed} == {"m0", "m1"}
    assert len({row["episode_uuid"] for row in followed}) == len(followed) > 60
    strata = read_table(folder / "strata.parquet").to_pylist()
    assert {"operator", "object", "calibration_epoch", "episode_order", "time_in_episode"} <= {
        row["variable"] for row in strata
    }


def test_what_was_not_recorded_is_said_so(tmp_path):
    data, replayed = planar(episodes=80)
    data = replace(data, episodes=replace(
        data.episodes, operator=np.full(80, ""), order=np.full(80, np.nan)))  # fmt: skip
    write(data, replayed, tmp_path / "blank")
    rows = {r["variable"]: r for r in read_table(tmp_path / "blank" / "strata.parquet").to_pylist()}
    for name in ("operator", "episode_order"):
        assert rows[name]["recorded"] is False and rows[name]["p_value"] is None
    assert rows["calibration_epoch"]["recorded"] is True


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
