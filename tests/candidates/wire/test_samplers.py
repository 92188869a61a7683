"""Other settings of a sampler that an entry names: asked for by name, measured, never judged."""

from contextlib import ExitStack

import numpy as np
import pytest

from genpolicy.candidates.brought import BroughtPolicy
from genpolicy.candidates.hosts.serving import _chosen
from genpolicy.candidates.judged import sampling_by
from genpolicy.candidates.wire.declared import Choice
from genpolicy.candidates.wire.extension import WORD, capabilities, request
from genpolicy.candidates.wire.faults import Fault
from genpolicy.candidates.wire.policy import WirePolicy
from genpolicy.candidates.wire.remote import RemotePolicy
from genpolicy.candidates.wire.served import ServedPolicy
from genpolicy.errors import ConfigError
from genpolicy.policies.settings import SamplerConfig

CHOICES = {"one": Choice(sampler="euler", sampler_steps=1)}


@pytest.fixture
def seen(data):
    return data.windows("test", 2, 16).observations[0]


@pytest.fixture
def asking(policy, serving, task, entry_of, tmp_path):
    """A policy behind the wire, whose server offers some settings."""
    remotes = []

    def ask(offered, named=CHOICES):
        served = ServedPolicy(policy, samplers=_chosen(policy, offered))
        entry = entry_of(samplers={name: one.model_dump() for name, one in named.items()})
        address = stack.enter_context(serving(served.answer, served.metadata))
        remotes.append(RemotePolicy(entry, address, task.observation))
        brought = BroughtPolicy(entry.name, tmp_path / "e.yaml", entry, entry.sha256, seed=0)
        return WirePolicy(brought, remotes[-1])

    with ExitStack() as stack:
        yield ask
        for remote in remotes:
            remote.close()


def test_a_setting_draws_what_these_weights_draw_under_it_and_the_judged_one_stays(
    asking, policy, seen
):
    asked = asking(CHOICES)
    assert asked.samplers == ["one"] and asked.told.samplers == ("one",)
    other = sampling_by(policy, SamplerConfig(name="euler", steps=1))
    for here, there in ((policy, asked), (other, asked.sampling_by("one"))):
        drawn = there.sample(seen[None], noise_names=[("a", 1)], candidates=2)
        own = here.sample(seen[None], noise_names=[("a", 1)], candidates=2)
        assert drawn.actions.tobytes() == own.actions.tobytes() and drawn.nfe == own.nfe
    hashes = {asked.sampler_config_hash, asked.sampling_by("one").sampler_config_hash}
    assert len(hashes) == 2 and not asked.faults


def test_a_setting_that_its_server_does_not_offer_costs_that_setting_alone(asking, seen):
    asked = asking({})
    tried = asked.sampling_by("one")
    drawn = tried.sample(seen[None], noise_names=[("a", 1)], candidates=2)
    assert np.isnan(drawn.actions).all() and tried.faults == {Fault.REFUSED: 1}
    assert not asked.faults
    assert np.isfinite(asked.sample(seen[None], noise_names=[("a", 1)], candidates=2).actions).all()


def test_who_offers_none_says_and_hears_what_it_did_before(policy, entry_of):
    assert "samplers" not in ServedPolicy(policy).metadata[WORD]
    assert capabilities(ServedPolicy(policy).metadata).samplers == ()
    assert set(request("1", ("a",), 2)[WORD]) == {"invocation", "noise", "candidates"}
    with_one = entry_of(samplers={"one": CHOICES["one"].model_dump()})
    assert entry_of(samplers={}).sha256 == entry_of().sha256 != with_one.sha256


def test_a_setting_that_is_none_of_its_method_is_refused_when_it_is_hosted(policy):
    with pytest.raises(ConfigError, match="samplers"):
        _chosen(policy, {"one": Choice(sampler="none", sampler_steps=1)})
    with pytest.raises(ConfigError):
        _chosen(policy, {"one": Choice(sampler="ddim", sampler_steps=4)})
