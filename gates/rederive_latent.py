"""Whether a latent answers the observation, tested again with the checkpoint that it is of."""

from dataclasses import fields

from gates.need.settings import MEASURED
from gates.rederive_measured import Bench, trained_in
from gates.stated import mapping, refuse, root_seed
from genpolicy.candidates.judged import sampling_by
from genpolicy.contract.settings import parse_settings
from genpolicy.evidence.documents.need import LATENT, Dependence, LatentDependence
from genpolicy.evidence.need.baselines import LatentTest
from genpolicy.evidence.need.latent import latent_dependence
from genpolicy.policies.settings import SamplerConfig

DOCUMENT = f"{MEASURED}/{LATENT.file}"
ROUNDED = 1e-3
"""Of a number, and of the permutations: what another processor may find otherwise. It draws the
same within 1e-5 and the test sees squares of that."""
SECTION = "measure_baselines"


def rederive_latent(bench: Bench) -> None:
    """Test the latent of every training again, as `params.yaml` plans it.

    Raises:
        RefusedError: A test lacks, stands twice or beside the plan, or found another number.
        ConfigError: A section of `params.yaml` cannot be read.
        IntegrityError: A file is missing, or is not what it claims to be.
        BadInputError: A table or document cannot be read.
    """
    params = bench.params
    planned = mapping(params.get(SECTION)).get("latent")
    stated: dict[tuple[str, str, int], LatentDependence] = {}
    for entry in LATENT.read(bench.root / MEASURED):
        key = (entry.method, entry.convention, entry.seed)
        if key in stated:
            refuse("A", _of(*key), "tested twice", "one test of each training")
        stated[key] = entry
    if planned is not None:
        test = parse_settings(LatentTest, planned, where=f"{SECTION}.latent")
        named = mapping(mapping(params[SECTION].get("conventions")).get(test.method))
        where = f"{SECTION}.conventions.{test.method}.{test.convention}"
        sampler = parse_settings(SamplerConfig, mapping(named.get(test.convention)), where=where)
        for seed, own in trained_in(bench, "train_baselines", test.method):
            held_out = bench.held_out(bench.horizons.observation_horizon)
            if len(held_out.situations) < 2:
                continue
            again = latent_dependence(
                sampling_by(own, sampler), held_out, samples=bench.number(SECTION, "samples"),
                permutations=test.permutations, root_seed=root_seed(params),
            )  # fmt: skip
            key = (test.method, test.convention, seed)
            if key not in stated:
                refuse("A", _of(*key), "not tested", "a test of each training")
            _compare(_of(*key), stated.pop(key), again)
    for key in stated:
        refuse("A", _of(*key), "a test", f"none: {SECTION}.latent plans another or none")


def _compare(place: str, stated: Dependence, again: Dependence) -> None:
    for field in fields(again):
        told, found = getattr(stated, field.name), getattr(again, field.name)
        apart = {"exceeding": ROUNDED * again.permutations}.get(field.name, ROUNDED * abs(found))
        if isinstance(found, int) and field.name != "exceeding":
            apart = 0.0
        if not abs(told - found) <= apart:
            refuse("A", f"{place}: {field.name}", f"{told:g}", f"{found:g}, as found again")


def _of(method: str, convention: str, seed: int) -> str:
    return f"{DOCUMENT}: {method} (seed {seed}) by {convention}"
