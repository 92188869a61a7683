"""LeRobot's own asynchronous client and server, tick by tick, without robot, network or waiting.

Runs in LeRobot's own environment (`make lerobot`), never in genpolicy's, and imports nothing of
genpolicy. Queue, threshold, aggregation, the time stamps of observations, and which of them the
server takes are LeRobot's methods (0.6.1); in place of robot and network stand lists of times, so
that nothing is executed and nothing is waited for.

    build/lerobot/bin/python adapters/lerobot_async.py < asked.json > ages.json

`asked.json`: `{"period_s", "rows", "threshold", "rule", "still", "runs": [{"ticks", "latencies_s":
[...]}, ...]}`. Printed is, for each run, at each tick the number of the oldest observation in what
was executed, or null where the queue was empty.
"""

import json
import logging
import sys
import threading
from queue import Empty, Queue
from types import SimpleNamespace

import torch
from lerobot.async_inference.configs import get_aggregate_function
from lerobot.async_inference.helpers import FPSTracker
from lerobot.async_inference.policy_server import PolicyServer
from lerobot.async_inference.robot_client import RobotClient

FAR = 10.0
"""How far the robot goes in a tick, in the units of its joints: never "similar" to the server."""
FEATURES = {"observation.state": {"dtype": "float32", "shape": (1,), "names": ["joint"]}}


class Robot:
    """Executes nothing; remembers what it was sent."""

    action_features = ("mixed", "oldest")

    def __init__(self, still: bool) -> None:
        self.tick, self.sent, self.still = 0, None, still

    def get_observation(self) -> dict:
        return {"joint": 0.0 if self.still else FAR * self.tick}

    def send_action(self, action: dict) -> dict:
        self.sent = action["oldest"]
        return action


class Run:
    """One client and its server on a clock of our own."""

    def __init__(self, asked: dict, latencies_s: list) -> None:
        logging.disable(logging.CRITICAL)
        self.period_s, self.rows = asked["period_s"], asked["rows"]
        self.latencies_s, self.pending = iter(latencies_s), None
        self.robot = Robot(asked["still"])
        mixed = get_aggregate_function(asked["rule"])
        # The first number is mixed as LeRobot mixes actions; the second is the oldest seen in it,
        # where anything of the old one is left.
        left = bool(mixed(torch.tensor(1.0), torch.tensor(0.0)) != 0.0)
        self.aggregate = lambda old, new: torch.stack(
            [mixed(old[0], new[0]), min(old[1], new[1]) if left else new[1]]
        )
        client = self.client = object.__new__(RobotClient)
        client.config = SimpleNamespace(
            fps=1.0 / self.period_s, environment_dt=self.period_s, aggregate_fn=self.aggregate
        )
        client.robot, client.fps_tracker = self.robot, FPSTracker(target_fps=1.0 / self.period_s)
        client.latest_action, client.action_chunk_size = -1, -1
        client.latest_action_lock, client.action_queue_lock = threading.Lock(), threading.Lock()
        client._chunk_size_threshold = asked["threshold"]
        client.action_queue, client.action_queue_size = Queue(), []
        client.must_go, client.shutdown_event = threading.Event(), threading.Event()
        client.must_go.set()
        server = self.server = object.__new__(PolicyServer)
        server.config = SimpleNamespace(environment_dt=self.period_s)
        server.observation_queue, server.last_processed_obs = Queue(maxsize=1), None
        server._predicted_timesteps, server._predicted_timesteps_lock = set(), threading.Lock()
        server.lerobot_features = FEATURES
        client.send_observation = self.seen

    def seen(self, observation: object) -> bool:
        """The line to the server: it takes no time of its own here."""
        observation.seen = self.robot.tick
        self.server._enqueue_observation(observation)
        return True

    def begin(self, now_s: float) -> None:
        """The server takes the one observation that waits."""
        try:
            observation = self.server.observation_queue.get_nowait()
        except Empty:
            return
        self.server._predicted_timesteps.add(observation.get_timestep())
        self.server.last_processed_obs = observation
        self.pending = now_s + next(self.latencies_s), observation

    def arrive(self, now_s: float) -> None:
        """What came until now is put into the queue; the server goes on with what waits."""
        while self.pending is not None and self.pending[0] <= now_s:
            done_s, observation = self.pending
            self.pending = None
            action = torch.tensor([0.0, float(observation.seen)], dtype=torch.float64)
            chunk = self.server._time_action_chunk(
                observation.get_timestamp(), [action] * self.rows, observation.get_timestep()
            )
            self.client.action_chunk_size = max(self.client.action_chunk_size, len(chunk))
            self.client._aggregate_action_queues(chunk, self.aggregate)
            self.client.must_go.set()
            self.begin(done_s)

    def tick(self, number: int) -> object:
        """One round of the client's control loop."""
        now_s, self.robot.tick, self.robot.sent = number * self.period_s, number, None
        self.arrive(now_s)
        if self.client.actions_available():
            self.client.control_loop_action()
        if self.client._ready_to_send_observation():
            self.client.control_loop_observation(task="")
        if self.pending is None:
            self.begin(now_s)
        return self.robot.sent


def main() -> None:
    asked = json.load(sys.stdin)
    ran = []
    for one in asked["runs"]:
        run = Run(asked, one["latencies_s"])
        sent = [run.tick(number) for number in range(one["ticks"])]
        ran.append([None if seen is None else int(seen) for seen in sent])
    json.dump(ran, sys.stdout)


if __name__ == "__main__":
    main()
