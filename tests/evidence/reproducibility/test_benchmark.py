"""The latency benchmark on a tiny policy, and its command line in a fresh process."""

import subprocess
import sys

import numpy as np
import pytest

from genpolicy.evidence.reproducibility.benchmark import measure_policy
from genpolicy.integrity.tables import read_table
from genpolicy.policies.checkpoint import load_checkpoint


@pytest.mark.parametrize("method", ["bc", "flow"])
def test_components_and_temperatures(folders, method, two_mode_windows):
    projected = []
    rows = measure_policy(
        folders[method],
        two_mode_windows(4).observations,
        expected_sha256=None,
        cold_repeats=2,
        warm_repeats=3,
        discarded_repeats=1,
        project=projected.append,
    )
    found = {(row.component, row.temperature, row.repeat) for row in rows}
    assert found == {
        (component, temperature, repeat)
        for component in ("preprocess", "encode", "sample", "select", "project")
        for temperature, count in (("cold", 2), ("warm", 3))
        for repeat in range(count)
    }
    assert all(row.seconds > 0 for row in rows)
    assert len(projected) == 6
    assert projected[0].selected_by == "first"


def test_without_a_projection_the_term_stays_unknown(folders, two_mode_windows):
    rows = measure_policy(
        folders["bc"], two_mode_windows(4).observations, expected_sha256=None,
        cold_repeats=1, warm_repeats=1,
    )  # fmt: skip
    assert "project" not in {row.component for row in rows}


def test_command_line_in_a_fresh_process(folders, tmp_path, two_mode_windows):
    np.save(tmp_path / "observations.npy", two_mode_windows(4).observations)
    command = [
        sys.executable, "-m", "genpolicy.evidence.reproducibility.measure",
        "--checkpoint", str(folders["flow"]),
        "--observations", str(tmp_path / "observations.npy"), "--cold", "1", "--warm", "2",
        "--out", str(tmp_path / "latency.parquet"), "--expected-sha256",
    ]  # fmt: skip
    identity = load_checkpoint(folders["flow"]).sha256
    assert subprocess.run([*command, identity], check=False).returncode == 0
    table = read_table(tmp_path / "latency.parquet")
    assert table.column_names == ["component", "temperature", "repeat", "seconds"]
    assert table.num_rows == 3 * 4
    refused = subprocess.run([*command, "0" * 64], check=False, capture_output=True, text=True)
    assert refused.returncode == 2
    assert "sha256" in refused.stderr
    assert "Traceback" not in refused.stderr
