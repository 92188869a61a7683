"""Every sampler and method that `params.yaml` names, looked at before anything trains.

Each is read by a stage of its own, some of them behind half an hour of training. What is wrong is
told with the key under which it stands.
"""

from collections.abc import Collection, Mapping

from pydantic import ConfigDict, Field

from genpolicy.contract.settings import Settings, parse_settings
from genpolicy.errors import ConfigError
from genpolicy.evidence.reproducibility.swept import SweepSection, tried_sampler
from genpolicy.policies.matched_training import PolicySettings
from genpolicy.policies.methods import check_sampler, method_named
from genpolicy.policies.settings import HeadConfig, SamplerConfig
from genpolicy.policies.variants import reference_of, resolved
from stages._stage import PARAMS, Params
from stages._training import FactorsSection, MethodsSection

Samplers = Mapping[str, SamplerConfig]

BASELINES, GENERATORS, FACTORS = "train_baselines", "train_generators", "train_factors"
KEYS = {
    "sampler_steps": "steps",
    "sampler.population": "population",
    "sampler.eta": "eta",
    "sampler.nfe_cap": "nfe_cap",
    "sampler": "name",
}
"""What a method calls an item of its sampler, and the key under which it is written."""


class LatentAsked(Settings):
    """Of `measure_baselines.latent` what names a sampler."""

    model_config = ConfigDict(extra="ignore")

    method: str
    convention: str


class Conventions(Settings):
    """Of section `measure_baselines` what names samplers; the stage itself reads the whole."""

    model_config = ConfigDict(extra="ignore")

    conventions: dict[str, dict[str, SamplerConfig]] = Field(default_factory=dict)
    latent: LatentAsked | None = None


def require_samplers(params: Params) -> list[str]:
    """Refuse a method or a sampler that is none, wherever one is named.

    Returns:
        Names of all that is trained here.

    Raises:
        ConfigError: A section that is no such, a method or sampler that does not exist or fit, a
            method without the one that it rests on, a sweep or convention of nobody.
    """
    head = params.section("policy", PolicySettings).head
    trained = {
        stage: params.section(stage, MethodsSection).samplers for stage in (BASELINES, GENERATORS)
    }
    for stage, samplers in trained.items():
        for name, sampler in samplers.items():
            place = f"{stage}.samplers.{name}"
            _require(place, name, sampler, head)
            _require_source(place, name, samplers)
    methods = _require_variants(params, trained[BASELINES], head)
    _require_conventions(params, trained[BASELINES], methods, head)
    _require_sweep(params, trained[GENERATORS], head)
    return [name for samplers in trained.values() for name in samplers]


def _require(place: str, method: str, sampler: SamplerConfig, head: HeadConfig) -> None:
    """A registered method, and a sampler that fits it, or an error that names the place."""
    try:
        chosen = method_named(method)
        check_sampler(chosen, sampler, head)
    except ConfigError as error:
        item = KEYS.get(error.where.removesuffix(f" of {method}"))
        where = f"{PARAMS}: {place}" + (f".{item}" if item else "")
        raise _at(where, error) from error


def _at(where: str, error: ConfigError) -> ConfigError:
    return ConfigError(where=where, found=error.found, expected=error.expected, action=error.action)


def _require_source(place: str, method: str, trained: Collection[str]) -> None:
    source = method_named(method).rests_on
    if source is not None and source not in trained:
        raise ConfigError(
            where=f"{PARAMS}: {place}",
            found=f"trained without {source}",
            expected=f"{source}, on which {method} rests, in the same section",
            action=f"Train {source} in the same stage, or leave {method} out.",
        )


def _require_variants(params: Params, baselines: Samplers, head: HeadConfig) -> set[str]:
    """Methods of the variants, each with a sampler that fits it."""
    variants = params.section(FACTORS, FactorsSection).variants
    reference_of(variants)
    for name, variant in variants.items():
        place = f"{FACTORS}.variants.{name}"
        try:
            method_named(variant.method)
        except ConfigError as error:
            raise _at(f"{PARAMS}: {place}.method", error) from error
        horizon = variant.observation_horizon
        if horizon is not None and not horizon >= 1:
            raise ConfigError(
                where=f"{PARAMS}: {place}.observation_horizon",
                found=str(horizon),
                expected="at least 1",
                action="Give the observations that condition an invocation.",
            )
    for name, (variant, sampler) in resolved(variants, baselines).items():
        _require(f"{FACTORS}.variants.{name}.sampler", variant.method, sampler, head)
    return {variant.method for variant in variants.values()}


def _require_conventions(
    params: Params, baselines: Samplers, methods: Collection[str], head: HeadConfig
) -> None:
    """Of baselines and of the variants of their methods, which are measured by them too."""
    place = "measure_baselines"
    section, of_variants = params.section(place, Conventions), dict.fromkeys(sorted(methods))
    for name, samplers in section.conventions.items():
        if samplers:
            _require_one_of(f"{place}.conventions.{name}", name, {**baselines, **of_variants})
        for convention, sampler in samplers.items():
            _require(f"{place}.conventions.{name}.{convention}", name, sampler, head)
    if section.latent is not None:
        asked, known = section.latent, section.conventions
        _require_one_of(f"{place}.latent.method", asked.method, known)
        _require_one_of(f"{place}.latent.convention", asked.convention, known[asked.method])


def _require_sweep(params: Params, candidates: Samplers, head: HeadConfig) -> None:
    for name, entries in params.section("reload", SweepSection).sweep.items():
        place = f"reload.sweep.{name}"
        if entries:  # where nothing is asked for, as in a file of overrides, nobody need be there
            _require_one_of(place, name, candidates)
        for number, entry in enumerate(entries):
            where, own = f"{place}[{number}]", candidates[name]
            tried = tried_sampler(own, entry)
            parse_settings(SamplerConfig, tried.model_dump(), where=f"{PARAMS}: {where}")
            _require(where, name, tried, head)


def _require_one_of(place: str, name: str, known: Collection[str]) -> None:
    if name not in known:
        raise ConfigError(
            where=f"{PARAMS}: {place}",
            found=repr(name),
            expected=f"one of {', '.join(known) or 'none'}",
            action="Correct the name, or remove the entry: it would ask for nothing.",
        )
