"""A replay for Rerun: every place of a replay, on the journal's clock; and without the library.

The library is an extra of half a gigabyte. Where it is missing, what is written is held against
its recorded calls; where it is there, the recording is read back, and the calls are held to it.
"""

import importlib
import importlib.util
import math
import sys

import pytest
from recorded_rerun import RECORDED, Library, bound, parameters_of
from replayed import SESSION

from genpolicy.errors import BadInputError, ConfigError
from genpolicy.execution.nanoseconds import NS_PER_S
from genpolicy.replay.journal_file import read_session
from genpolicy.replay.replay import write_replay
from genpolicy.replay.rerun_form import CLOCK, write_rerun

INSTALLED = importlib.util.find_spec("rerun") is not None


@pytest.fixture
def library(monkeypatch):
    found = Library()
    monkeypatch.setitem(sys.modules, "rerun", found)
    return found


@pytest.fixture(params=["recorded", "installed"])
def either(request):
    """The stand-in, and the library where it is there."""
    if request.param == "recorded":
        request.getfixturevalue("library")
    elif not INSTALLED:
        pytest.skip("rerun-sdk is not installed")


def test_without_the_library_it_says_what_to_install(journal, tmp_path, monkeypatch):
    monkeypatch.setitem(sys.modules, "rerun", None)
    with pytest.raises(ConfigError, match=r"without the library rerun-sdk.*genpolicy\[rerun\]"):
        write_rerun(journal, tmp_path / "r.rrd", session=SESSION, task=None)
    assert not (tmp_path / "r.rrd").exists()


@pytest.mark.usefixtures("either")
def test_it_has_what_a_replay_has_and_force_and_age(journal, tmp_path):
    counts = write_rerun(journal, tmp_path / "r.rrd", session=SESSION, task=None)
    drawn = write_replay(journal, tmp_path / "r.mcap", session=SESSION, task=None).topics
    assert {place: n for place, n in counts.items() if place.startswith("/replay/")} == drawn
    assert counts["/journal/accept/age"] == drawn["/replay/commanded"]
    assert (tmp_path / "r.rrd").read_bytes()


def test_every_message_stands_where_and_when_the_journal_says_in_finite_numbers(
    journal, tmp_path, library
):
    write_rerun(journal, tmp_path / "r.rrd", session=SESSION, task=None)
    ((name, messages),) = library.logged
    assert name == SESSION
    kinds = {kind for _, _, kind, _ in messages}
    assert kinds >= {"Clear", "Transform3D", "Scalars", "Boxes3D", "LineStrips3D"}, kinds
    events = [one.event for one in read_session(journal, SESSION).events]
    last_s = max(event.t for event in events) / NS_PER_S
    assert all(0 <= time_s <= last_s for time_s, *_ in messages)
    accepted = [event for event in events if event.kind == "accept"]
    ages = [(at, shape) for at, place, _, shape in messages if place == "/journal/accept/age"]
    assert [at for at, _ in ages] == [max(event.t, 0) / NS_PER_S for event in accepted]
    assert [shape["scalars"] * NS_PER_S for _, shape in ages] == pytest.approx(
        [event.payload["age_ns"] for event in accepted]
    )
    for _, place, kind, shape in messages:
        assert place.startswith(("/replay/", "/journal/")), place
        for field in ("half_sizes", "centers", "strips", "positions", "translation"):
            assert all(map(math.isfinite, _numbers(shape.get(field, [])))), (place, kind)
        if "half_sizes" in shape:
            assert min(_numbers(shape["half_sizes"])) > 0, (place, kind)


def _numbers(value) -> list[float]:
    return [value] if isinstance(value, float) else [n for one in value for n in _numbers(one)]


def test_the_stand_in_refuses_what_the_library_refuses():
    assert bound("TextLog", "x", level="INFO") == {"text": "x", "level": "INFO"}
    for call, given in (("TextLog", {"colour": 1}), ("Clear", {}), ("Scalars", {"scalar": 1.0})):
        with pytest.raises(TypeError):
            bound(call, **given)


@pytest.mark.skipif(not INSTALLED, reason="rerun-sdk is not installed")
@pytest.mark.parametrize("call", RECORDED)
def test_the_recorded_calls_are_those_of_the_installed_library(call):
    rerun = importlib.import_module("rerun")
    name, _, method = call.partition(".")
    shape = getattr(rerun, name)
    assert parameters_of(getattr(shape, method) if method else shape.__init__) == RECORDED[call]


def test_the_recording_can_be_read_and_its_times_are_those_of_the_journal(journal, tmp_path):
    chunk = pytest.importorskip("rerun.chunk")
    write_rerun(journal, tmp_path / "r.rrd", session=SESSION, task=None)
    store = chunk.RrdReader(tmp_path / "r.rrd").store()
    said = str(store.schema())
    for place in ("/replay/robot", "/replay/commanded", "/replay/raw", "/replay/projected",
                  "/replay/joints/commanded", "/journal/accept/age"):  # fmt: skip
        assert place in said
    assert CLOCK in said and "log_time" not in said


@pytest.mark.usefixtures("either")
def test_an_unknown_session_is_refused_and_nothing_is_written(journal, tmp_path):
    with pytest.raises(BadInputError, match="one of"):
        write_rerun(journal, tmp_path / "r.rrd", session="none", task=None)
    assert not (tmp_path / "r.rrd").exists()
