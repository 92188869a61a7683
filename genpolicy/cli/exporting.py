"""`genpolicy export`: a dataset in a layout that others train from."""

from pathlib import Path

from genpolicy.data.dataset import load_dataset
from genpolicy.data.exports.lerobot import export_lerobot
from genpolicy.errors import ConfigError
from genpolicy.integrity.atomic import output_folder


def run_export_lerobot(dataset: Path, out: Path, *, split: str) -> int:
    """Write a split of a dataset for LeRobot, and print what was written.

    Raises:
        ConfigError: The place lies inside the dataset.
        BadInputError: The dataset is missing or not whole, or the place cannot be written.
        ContractError: What LeRobot cannot hold.
    """
    if dataset.resolve() in (out.resolve(), *out.resolve().parents):
        raise ConfigError(
            where="--out",
            found=f"{out}, inside the dataset",
            expected="a folder of its own",
            action="Name another folder; nothing was written.",
        )
    data = load_dataset(dataset)
    with output_folder(out) as folder:
        written = export_lerobot(data, folder, split=split)
    print(f"dataset   {out}")
    print(f"split     {split}; train on nothing else what is to be judged here")
    print(f"episodes  {written.episodes} ({written.left_out} that did not succeed are left out)")
    print(f"frames    {written.frames}")
    for name, width in written.features.items():
        print(f"feature   {name} ({width})")
    return 0
