"""The Prefect server: is one there, does it still answer, and what to do when it falls silent."""

import os
import sys
import threading
import time
from collections.abc import Callable

from flows import prefect_settings  # noqa: F401

# isort: split
import httpx
from prefect import get_client
from prefect.settings import PREFECT_API_URL, PREFECT_HOME

from flows.reproduce import EXIT_FAULT, stop_all

# A server that does not answer is given up well within a minute, not after Prefect's 138 s.
FIRST_ANSWER_S = 10.0
SILENCE_S = 30.0
PROBE_PERIOD_S = 3.0


class watch_server:  # noqa: N801  (used like a function, as a context)
    """Ends the process, and the stage that it runs, when the Prefect server falls silent.

    Args:
        url: Address of the server's API.
        silence_s: How long it may stay silent.
        period_s: Time between two questions.
        answers: Asks the server; a parameter for tests.
        give_up: Called once when the server is given up; a parameter for tests.
        clock: Says how late it is, s; a parameter for tests.
    """

    def __init__(
        self,
        url: str,
        *,
        silence_s: float = SILENCE_S,
        period_s: float = PROBE_PERIOD_S,
        answers: Callable[[str], bool] | None = None,
        give_up: Callable[[str], None] | None = None,
        clock: Callable[[], float] = time.monotonic,
    ) -> None:
        self._url = url
        self._silence_s = silence_s
        self._period_s = period_s
        self._answers = answers or server_answers
        self._give_up = give_up or _leave
        self._clock = clock
        self._done = threading.Event()
        self._thread = threading.Thread(target=self._watch, name="server watch", daemon=True)

    def __enter__(self) -> "watch_server":
        self._thread.start()
        return self

    def __exit__(self, *_: object) -> None:
        self._done.set()

    def _watch(self) -> None:
        heard = self._clock()
        while not self._done.wait(self._period_s):
            if self._answers(self._url):
                heard = self._clock()
            elif self._clock() - heard >= self._silence_s:
                self._give_up(self._url)
                return


def server_url() -> str | None:
    """Address of the Prefect server that the settings name; None for a temporary one."""
    url = PREFECT_API_URL.value()
    return str(url) if url else None


def database() -> str:
    """Where runs are looked for: at the server that the settings name, or in which folder."""
    return server_url() or f"the database below {PREFECT_HOME.value()}"


def server_answers(url: str, *, timeout_s: float = FIRST_ANSWER_S) -> bool:
    """Whether a Prefect server answers at `url` within the time given."""
    try:
        return httpx.get(f"{url.rstrip('/')}/health", timeout=timeout_s).status_code == 200
    except httpx.HTTPError:
        return False


def server_is_there() -> bool:
    """Whether the server answers that the settings name; says what to do where it does not.

    Without one in the settings a temporary one is started by whoever asks first.
    """
    url = server_url()
    if not url or server_answers(url):
        return True
    print(
        f"PREFECT_API_URL is {url}, where no server answers within {FIRST_ANSWER_S:.0f} s, "
        "expected a running Prefect server. Start it, unset the variable, or run "
        "`python -m flows.reproduce`, which needs none.",
        file=sys.stderr,
    )
    return False


def api_url() -> str:
    """Address of the server that is asked, a temporary one included."""
    with get_client(sync_client=True) as client:
        return str(client.api_url)


def _leave(url: str) -> None:
    print(
        f"The Prefect server at {url} has not answered for {SILENCE_S:.0f} s; the stage was "
        "stopped. Run again, or use `python -m flows.reproduce`, which needs no server.",
        file=sys.stderr,
        flush=True,
    )
    stop_all()
    os._exit(EXIT_FAULT)
