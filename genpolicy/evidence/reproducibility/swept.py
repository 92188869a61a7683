"""What `reload.sweep` asks for: further samplers of a candidate, as settings; nothing is drawn."""

from collections.abc import Mapping, Sequence

from pydantic import Field

from genpolicy.contract.settings import Settings
from genpolicy.policies.settings import SamplerConfig

Sweep = Mapping[str, Sequence[int | SamplerConfig]]


class SweepSection(Settings):
    """Of section `reload` what the stages of the sweep share.

    Attributes:
        sweep: Samplers to try besides the chosen one, by method; a number is that many steps of
            the chosen one.
        samples: Candidates per situation.
    """

    sweep: dict[str, list[int | SamplerConfig]]
    samples: int = Field(ge=2)


def tried_sampler(own: SamplerConfig, entry: int | SamplerConfig) -> SamplerConfig:
    """The sampler that an entry of the sweep asks for, of a candidate with a sampler of its own."""
    return own.model_copy(update={"steps": entry}) if isinstance(entry, int) else entry


def swept_samplers(own: SamplerConfig, sweep: Sequence[int | SamplerConfig]) -> list[SamplerConfig]:
    """The candidate's own sampler and those to try, each once, by name and steps."""
    tried = [tried_sampler(own, entry) for entry in sweep]
    different = {sampler.hash(): sampler for sampler in (own, *tried)}
    return sorted(different.values(), key=lambda sampler: (sampler.name, sampler.steps))


def beside_steps(sampler: SamplerConfig) -> str:
    """What else of a sampler is not as by default: by it two of one name and steps are told apart.

    Its tolerance has a column of its own.
    """
    own = {
        name: getattr(sampler, name)
        for name, item in SamplerConfig.model_fields.items()
        if name not in ("name", "steps", "tolerance") and getattr(sampler, name) != item.default
    }
    return told_apart(own)


def told_apart(settings: Mapping[str, float | None]) -> str:
    """Settings beside name and steps, as a column and a page say them."""
    return ", ".join(
        f"{name} {'none' if value is None else f'{value:g}'}" for name, value in settings.items()
    )
