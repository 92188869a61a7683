"""A dataset folder that was ingested before: opened as it is."""

from pathlib import Path
from typing import Any

from genpolicy.data.assemble import MANIFEST_FILE, REFUSALS_FILE, Refusal
from genpolicy.data.dataset import load_dataset
from genpolicy.data.formats.contract import (
    ActionSource,
    ChannelSource,
    ImportContract,
    Labels,
    contract_of,
)
from genpolicy.data.formats.pairing import pair_by_name
from genpolicy.data.formats.result import Opened
from genpolicy.integrity.documents import read_json


def open_ingested(path: Path, contract: ImportContract | None) -> Opened:
    """A dataset folder, verified, with the contract that its manifest carries or implies.

    Raises:
        BadInputError: Not such a folder, or changed since it was written.
    """
    manifest = load_dataset(path).manifest
    stored = manifest.get("import_contract")
    if contract is None and stored is not None:
        contract = contract_of(stored, where=f"{path / MANIFEST_FILE}: import_contract")
    refusals = read_json(path / REFUSALS_FILE)
    return Opened(
        folder=path,
        contract=contract or contract_of_manifest(manifest, where=str(path / MANIFEST_FILE)),
        found=int(manifest["counts"]["found"]),
        accepted=int(manifest["counts"]["accepted"]),
        refused=tuple(Refusal(**item) for item in refusals["refused"]),
        notes=tuple(str(note) for note in manifest.get("notes", ())),
    )


def contract_of_manifest(manifest: dict[str, Any], *, where: str) -> ImportContract:
    """What a manifest without an import contract implies: its own names and units.

    Raises:
        ConfigError: Its contracts cannot be expressed, for instance a channel name with a space.
    """
    channels = [
        ChannelSource(
            name=channel["name"],
            columns=[f"{channel['name']}[{i}]" for i in range(len(channel["components"]))],
            components=list(channel["components"]),
            unit=channel["unit"],
            stream=channel["stream"],
            maximum_age_s=channel["maximum_age_s"],
        )
        for channel in manifest["observation_contract"]["channels"]
    ]
    stated = manifest["action_contract"]
    action = ActionSource(
        columns=[f"action[{i}]" for i in range(len(stated["components"]))],
        components=list(stated["components"]),
        units=list(stated["units"]),
        frame=stated["frame"],
    )
    streams = {channel.stream for channel in channels}
    values = ImportContract(
        format="dataset",
        task=", ".join(manifest["tasks"]) or "unnamed",
        rate_hz=1.0 / float(stated["period_s"]),
        channels=channels,
        action=action,
        pairing=pair_by_name(channels, action),
        # The phase was recorded; a policy sees it only if it is a channel.
        labels=Labels(phase=None if len(manifest["phases"]) < 2 or "phase" in streams else "phase"),
        phases=list(manifest["phases"]),
    )
    return contract_of(values.model_dump(), where=where)
