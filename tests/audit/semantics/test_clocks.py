"""Clocks: lag by episode, offsets of epochs and single episodes, drift, streams, realignment."""

from dataclasses import replace

import numpy as np
import pytest
from arms import SETTINGS, arms, last_epoch, late

from genpolicy.audit.semantics import measure
from genpolicy.audit.semantics.clocks import offset_findings
from genpolicy.seeds import stream


def kinds(data, settings=SETTINGS):
    return [finding.kind for finding in measure(data, settings).findings]


def test_an_episode_is_off_only_beyond_its_own_error():
    data = arms(21)
    offsets = 0.1 + 0.001 * stream(7, "offsets").normal(size=60)
    offsets[[3, 9, 27, 40]] += 0.08
    limits = {"declared_s": None, "finest_s": 0.0125, "episode_limit_s": 0.0375}
    sure, taken = offset_findings(
        "robot", offsets, data, SETTINGS, **limits, errors_s=np.full(60, 0.002)
    )
    assert [d.kind for d in sure] == ["clock"] and np.flatnonzero(taken).tolist() == [3, 9, 27, 40]
    unsure, taken = offset_findings(
        "robot", offsets, data, SETTINGS, **limits, errors_s=np.full(60, 0.03)
    )
    assert unsure == [] and not taken.any()


@pytest.mark.parametrize(("rate_hz", "width", "unit"), [(5, 2, 1.0), (20, 3, 500.0), (40, 7, 1.0)])
def test_an_epoch_that_is_late_by_a_row_is_named_at_any_rate_and_in_any_unit(rate_hz, width, unit):
    data = arms(11, rate_hz=rate_hz, width=width, unit=unit)
    assert kinds(data) == []
    found = measure(late(data, 1.0, last_epoch(data)), SETTINGS)
    assert found.findings[0].kind == "clock" and "epoch e" in found.findings[0].where
    offsets = {clock.epoch: clock.offset_before_s for clock in found.clocks}
    assert offsets["e1"] - offsets["e0"] == pytest.approx(1 / rate_hz, abs=0.2 / rate_hz)


def test_one_late_episode_is_no_defect_of_the_data_set():
    data = arms(13, episodes=100)
    one = np.arange(100) == 41
    assert kinds(late(data, 3.0, one)) == []


def test_a_response_before_its_command_is_named_everywhere():
    data = arms(16, epochs=1, lag_s=0.01)
    assert kinds(data) == []
    assert kinds(late(data, -3.0, np.ones(60, dtype=bool))) == ["clock"]
    declared = SETTINGS.model_copy(update={"declared_lag_rows": 4.0})
    assert "clock" in kinds(data, declared)


def test_stamps_that_say_too_early_show_in_the_delay_where_no_row_could_move():
    # A row holds what was received; a sample stamped 80 ms early is no earlier there.
    data = arms(17)
    name, rng = data.position_stream, stream(17, "delay")
    delay = 0.002 + 0.0005 * rng.random(len(data.episode))
    honest = replace(data, delay_s={name: delay})
    assert kinds(honest) == []
    off = delay + 0.08 * last_epoch(data)[data.episode]
    found = measure(replace(data, delay_s={name: off}), SETTINGS)
    (finding,) = found.findings
    assert (finding.kind, finding.variable) == ("clock", name) and "epoch e" in finding.where
    assert finding.measured == pytest.approx(0.08, abs=0.001)
    # Its rows stand where they were recorded: nothing is to be moved.
    assert not found.shift_rows.any()
