"""What the kernel says of a thread: parsed, bounded, and unknown where nobody counts."""

import threading

import pytest

from genpolicy.evidence.reproducibility.processor import (
    Moment,
    machine_between,
    machine_now,
    run_queue,
    waited_s,
)

START = Moment(thread_s=5.0, process_s=7.0, queued_s=2.0)


def after(*, ran=0.0, beside=0.0, queued=0.0):
    """A moment behind `START`: this thread ran, others of its process ran, this one queued."""
    return Moment(5.0 + ran, 7.0 + ran + beside, 2.0 + queued)


@pytest.mark.parametrize(
    ("used", "wall_s", "expected"),
    [
        ({"ran": 1.0, "queued": 2.0}, 3.0, 2.0),  # ran and waited its turn
        ({"ran": 1.0}, 3.0, 0.0),  # slept, or waited for a lock, a disk, another process
        ({"ran": 1.0, "queued": 0.5}, 3.0, 0.5),  # waited its turn, and slept
        ({"ran": 1.0, "beside": 2.0, "queued": 2.0}, 3.0, 0.0),  # for its own threads
        ({"ran": 1.0, "beside": 1.5, "queued": 2.0}, 3.0, 0.5),  # partly for its own threads
        ({"ran": 1.0, "queued": 9.0}, 3.0, 2.0),  # never more than it did not run
        ({"ran": 3.5, "queued": 0.0}, 3.0, 0.0),
        ({"ran": 1.0, "beside": -0.1, "queued": 1.0}, 3.0, 1.0),  # clocks read one after another
    ],
)
def test_only_the_turn_of_others_counts_as_waiting(used, wall_s, expected):
    assert waited_s(START, after(**used), wall_s=wall_s) == pytest.approx(expected)


@pytest.mark.parametrize("side", ["before", "after"])
def test_what_nobody_counts_is_unknown_and_not_zero(side):
    silent = Moment(5.0, 7.0, None)
    ends = (silent, after(queued=1.0)) if side == "before" else (START, silent)
    assert waited_s(*ends, wall_s=1.0) is None


@pytest.mark.parametrize(
    ("text", "queued_s"),
    [("15 2500000000 3\n", 2.5), ("0 0 0\n", None), ("15\n", None), ("", None)],
)
def test_the_second_number_of_the_kernels_account_is_the_queue_in_ns(tmp_path, text, queued_s):
    file = tmp_path / "schedstat"
    file.write_text(text)
    with run_queue(file) as queue:
        assert queue.now().queued_s == queued_s


def test_without_an_account_nothing_is_known(tmp_path):
    with run_queue(tmp_path / "none") as queue:
        assert queue.now().queued_s is None


def test_a_thread_that_waits_for_another_stands_in_no_queue():
    """It waits a long time of the clock that the other one decides; nothing of it is the queue's,
    beyond what the machine takes for waking it."""
    go = threading.Event()

    def work():
        sum(range(3_000_000))
        go.set()

    with run_queue() as queue:
        before = queue.now()
        other = threading.Thread(target=work)
        other.start()
        go.wait()
        end = queue.now()
        other.join()
    if before.queued_s is None:
        pytest.skip("this kernel counts no time in the run queue")
    beside_s = end.process_s - before.process_s - (end.thread_s - before.thread_s)
    assert beside_s > 0.0
    waited = waited_s(before, end, wall_s=1e9)
    assert waited <= end.queued_s - before.queued_s


STAT = "cpu  100 20 30 4000 50 6 7 80 0 0\ncpu0 1 1 1 1 1 1 1 1 0 0\n"


def test_work_of_all_and_what_was_stolen_are_read_from_the_first_line(tmp_path):
    file = tmp_path / "stat"
    file.write_text(STAT)
    found = machine_now(file)
    # By hand: 100 + 20 + 30 + 6 + 7 ticks of work, 80 stolen; idle and iowait are no work.
    ticks = found.busy_s / 163
    assert ticks > 0 and found.stolen_s == pytest.approx(80 * ticks)


@pytest.mark.parametrize("text", ["", "intr 1 2 3\n", "cpu  1 2 3 4\n"])
def test_a_machine_of_which_nothing_is_told(tmp_path, text):
    file = tmp_path / "stat"
    file.write_text(text)
    assert machine_now(file).busy_s is None and machine_now(file).stolen_s is None
    assert machine_now(tmp_path / "none").busy_s is None
    between = machine_between(machine_now(file), machine_now(file))
    assert between.others_s is None and between.stolen_s is None and between.cpus >= 1


def test_what_this_process_did_is_not_the_others(tmp_path):
    """The account of all stands still, so that whatever was done here was done by nobody else."""
    file = tmp_path / "stat"
    file.write_text(STAT)
    before = machine_now(file)
    sum(range(1_000_000))
    found = machine_between(before, machine_now(file))
    assert found.cpu_s > 0 and found.others_s == 0.0 and found.stolen_s == 0.0
    assert found.seconds > 0 and found.voluntary >= 0 and found.involuntary >= 0
