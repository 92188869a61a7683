"""The benchmark of sampling runs to its end with tiny counts, every way in it."""

import re
from types import SimpleNamespace

import pytest

pytest.importorskip("diffusers")

from benchmarks import sampling

HEADS = ["diffusers", "plain", "deployed", "onnx", "products"]


def test_every_way_is_timed_for_every_number_of_threads(capsys, monkeypatch):
    """The check inside it asks that all ways draw the same; it would end the process."""
    pytest.importorskip("onnxruntime")
    monkeypatch.setattr(sampling, "DISCARDED", 0)
    asked = []

    def answered(command, **_):
        asked.append(command[command.index("--first") + 1])
        return SimpleNamespace(stdout="1.5\n")

    monkeypatch.setattr(sampling.subprocess, "run", answered)
    sampling.main(
        ["--threads", "1", "2", "--candidates", "1", "2", "--repeats", "1", "--first-calls", "2"]
    )
    lines = capsys.readouterr().out.splitlines()
    told = [line for line in lines if "ms" in line]
    assert [re.sub(r" \(.*", "", line) for line in told] == [
        "16 DDIM steps, 1 thread, processor ms", "first call of a process, wall ms",
        "16 DDIM steps, 2 threads, wall ms", "first call of a process, wall ms",
    ]  # fmt: skip
    heads = [line.split()[1:] for line in lines if line.startswith("candidates")]
    ratios = ["diffusers/deployed", "deployed/products"]
    assert heads == [[*HEADS, *ratios], [*HEADS[:-1], ratios[0]]] * 2
    rows = [line.split() for line in lines if line[:1].isdigit() and "ms" not in line]
    assert [row[0] for row in rows] == ["1", "2"] * 4
    assert all(float(number) > 0.0 for row in rows for number in row[1:])
    # In turns, process by process, for both numbers of candidates and of threads.
    assert asked == HEADS[:-1] * 2 * 2 * 2


def test_the_first_call_is_timed_in_an_interpreter_of_its_own(tmp_path):
    sampling.untrained(tmp_path / "checkpoint")
    found = sampling.first_calls(
        tmp_path / "checkpoint", ["deployed"], count=1, threads=1, repeats=1
    )
    assert found["deployed"] > 0.0


def test_without_the_library_its_way_is_left_out(capsys, monkeypatch):
    monkeypatch.setattr(sampling, "find_spec", lambda name: None)
    monkeypatch.setattr(sampling, "DISCARDED", 0)
    sampling.main(["--candidates", "1", "--repeats", "1", "--first-calls", "0"])
    said = capsys.readouterr().out
    assert "is not installed" in said and "deployed" in said
    assert " onnx " not in said


def test_a_way_that_draws_something_else_ends_it(tmp_path, monkeypatch):
    policy = sampling.untrained(tmp_path / "checkpoint")
    own = sampling.Contenders(policy, 1, program=object())
    monkeypatch.setattr(own, "onnx", lambda: own.deployed() + 1e-3)
    with sampling.torch.inference_mode(), pytest.raises(SystemExit, match="exported program"):
        own.check()
