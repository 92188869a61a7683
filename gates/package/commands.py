"""`genpolicy package` and `genpolicy verify bundle`: evidence that travels."""

import tempfile
from pathlib import Path
from typing import Annotated

import typer

from genpolicy.cli.shell import AsJson, with_examples

Root = Annotated[Path, typer.Option(help="Repository root.")]


@with_examples("genpolicy package flow", "genpolicy package flow --out flow.zip")
def package(
    candidate: Annotated[str, typer.Argument(help="Its name in the tables.")],
    out: Annotated[
        Path | None, typer.Option(help="File to write; build/bundles/NAME-ADDRESS.zip if absent.")
    ] = None,
    root: Root = Path(),
) -> int:
    """Put all evidence of a candidate into one file.

    The eleven groups of artifacts, everything that the verdicts of gates A to D
    rest on, and a statement for each gate; complete, or nothing is written. The
    address names every byte: hand it over by another way than the file. Cards
    and keys stay here.
    """
    from gates.package.bundling import package as write

    done = write(root, candidate, out)
    index = done.index
    size = sum(file.size for file in index.files.values())
    print(f"Wrote {done.path}: {len(index.files)} files, {size / 2**20:.1f} MiB.")
    print(f"Address {index.address}")
    print("Gates   " + ", ".join(f"{gate} {text}" for gate, text in index.verdicts.items()))
    for group in index.groups:
        left = f"; not measured: {group.unmeasured}" if group.unmeasured else ""
        print(f"{group.number:>5}  {group.title}: {len(group.files)} files{left}")
    return 0


def verify_bundle(
    bundle: Annotated[Path, typer.Argument(help="File that `genpolicy package` wrote.")],
    address: Annotated[
        str, typer.Option(help="Address that was handed over, or its first 32 digits.")
    ] = "",
    run_programs: Annotated[
        bool, typer.Option("--run-programs", help="Start the policies that it brings.")
    ] = False,
    as_json: AsJson = False,
) -> int:
    """Prove a bundle on another machine.

    Every byte is hashed, gates A to D are judged again, the evidence is derived
    again and the pages are printed again: the independent checker reads the
    journals. By the code, task and libraries that are here, which must be those
    that judged; nothing of the bundle is run. Exit 0 if all is as it says
    (whatever the verdicts are), 3 if a report is untrue, 2 if the bundle cannot
    be read, or it says other than its evidence.
    """
    from gates.package.proving import prove_bundle
    from gates.printed import print_rungs, worst

    with tempfile.TemporaryDirectory(prefix="genpolicy-bundle-") as folder:
        index, rungs = prove_bundle(
            bundle, Path(folder), address=address, run_programs=run_programs
        )
    print_rungs(rungs, as_json)
    codes = {rung.exit_code for rung in rungs if rung.verdict == "REFUSED"}
    if not as_json and not codes:
        print(f"{index.candidate}: all {len(index.files)} files are what the address names.")
        print(f"Address {index.address}")
        print("Limits, as git said where it was packaged; nothing here derives it again:")
        print("\n".join(f"  {line}" for line in index.limits))
    return worst(codes)
