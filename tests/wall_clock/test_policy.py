"""The policy's process answers what it is asked with what the policy samples."""

import os
import threading
from types import SimpleNamespace

import numpy as np
import yaml
from arranged import GUARD_S, wait_for

from genpolicy.candidates.wire.connection import free_port
from genpolicy.candidates.wire.faults import Fault
from genpolicy.candidates.wire.policy import WireSamples
from genpolicy.wall_clock.channel import Inbox, Outbox
from genpolicy.wall_clock.messages import Ask, read_answer
from genpolicy.wall_clock.policy import answer_of, main
from tests.candidates.conftest import ENTRY


def test_an_answer_is_the_sample_of_that_observation(fleet, policy, data):
    folder = fleet[0] / "flow" / "seed_0"
    (asks_r, asks_w), (answers_r, answers_w) = os.pipe(), os.pipe()
    ready_r, ready_w = os.pipe()
    words = [str(folder), policy.checkpoint_hash, "--device", "cpu", "--asks", str(asks_r),
             "--answers", str(answers_w), "--ready", str(ready_w)]  # fmt: skip
    serving = threading.Thread(target=main, args=(words,), daemon=True)
    serving.start()
    assert os.read(ready_r, 1) == b"."  # nobody has asked it yet
    assert os.read(ready_r, 1) == b""
    os.close(ready_r)
    seen = data.frames.observation[:2]
    outbox, inbox = Outbox(asks_w), Inbox(answers_r)
    outbox.send(Ask("0", seen, ("episode", "1")).encoded())
    answer = read_answer(wait_for(inbox.read)[0])
    drawn = policy.sample(seen[None], noise_names=[("episode", "1")], candidates=1)
    assert answer.actions.tobytes() == np.ascontiguousarray(drawn.actions[0, 0]).tobytes()
    assert (answer.invocation, answer.method) == ("0", "flow")
    assert (answer.checkpoint, answer.sampler) == (
        policy.checkpoint_hash, policy.sampler_config_hash
    )  # fmt: skip
    outbox.close()
    serving.join(GUARD_S)
    assert not serving.is_alive()


def test_a_server_that_is_gone_before_it_is_asked_is_one_sentence(tmp_path, capsys):
    """Red before: a traceback. Whoever started it sees that the process is gone, as ever."""
    entry = tmp_path / "candidate.yaml"
    entry.write_text(yaml.safe_dump(ENTRY))
    address = f"ws://127.0.0.1:{free_port()}"
    words = ["--address", address, "--task", "tabletop_insertion", "--asks", "0", "--answers", "1"]
    assert main([str(entry), "c" * 64, *words]) == 2
    [said] = capsys.readouterr().err.splitlines()
    assert said.startswith(f"{entry} answers nothing by the wall clock: the policy's process is at")
    assert f"nobody answers at {address}" in said


def test_an_invocation_whose_process_failed_is_no_answer(data):
    """It would be a refusal by feasibility, where rollouts count a missed deadline."""
    chunks = np.full((1, 1, 16, 10), np.nan)
    for fault in (Fault.LATE, None):
        drawn = WireSamples(chunks, 0, (fault,))
        policy = SimpleNamespace(
            sample=lambda *_, drawn=drawn, **__: drawn,
            checkpoint_hash="c", sampler_config_hash="s", method="m",
        )  # fmt: skip
        asked = Ask("0", data.frames.observation[:2], ("episode", "1"))
        assert (answer_of(policy, asked, candidates=1) is None) == (fault is not None)
