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
    address names every byte: hand it over by another way than the file.
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
        str, typer.Option(help="Address that was handed over, or its first digits (12 or more).")
    ] = "",
    run_programs: Annotated[
        bool, typer.Option("--run-programs", help="Start the policies that it brings.")
    ] = False,
    as_json: AsJson = False,
) -> int:
    """Prove a bundle on any machine.

    Every byte is hashed, every gate judged again and the evidence derived again:
    the independent checker reads the journals. By the code that runs here, which
    must be the code that judged; that of the bundle is never run. Exit 0 if all
    is as it says (whatever the verdicts are), 3 if a report or the front page is
    untrue, 2 if the bundle cannot be read or its bytes are others.
    """
    from gates.package.archive import read_index
    from gates.package.bundling import prove_bundle
    from gates.printed import pages_code, print_rungs, worst
    from genpolicy.errors import BadInputError

    found = read_index(bundle).address
    if address and (len(address) < 12 or not found.startswith(address)):
        raise BadInputError(
            where=str(bundle),
            found=f"address {found}",
            expected=f"{address} (at least 12 digits)",
            action="This is another bundle than the one you were told of.",
        )
    with tempfile.TemporaryDirectory(prefix="genpolicy-bundle-") as folder:
        index, rungs = prove_bundle(bundle, Path(folder), run_programs=run_programs)
        codes = {rung.exit_code for rung in rungs if rung.verdict == "REFUSED"}
        codes |= pages_code(Path(folder))
    print_rungs(rungs, as_json)
    if not as_json and not codes:
        print(f"{index.candidate}: all {len(index.files)} files are what the address names.")
    return worst(codes)
