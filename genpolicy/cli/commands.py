"""The commands of this package: what each one takes, and the help that says so."""

from collections.abc import Sequence
from pathlib import Path
from typing import Annotated, Literal

import typer

from genpolicy.cli.shell import AsJson, Registered, examples, new_app, run_program

DESCRIPTION = """A promotion ladder for generative robot policies.

Import recordings, audit them, run the ladder of five gates, prove its reports,
sign and verify trial cards.

Exit codes: 0 done, 1 a fault of ours, 2 bad usage, configuration or input,
3 refused by a gate (it does not pass, or its report is untrue), 130 interrupted.
"""

# Named here once more, because their home loads every table library; a test holds both together.
Format = Annotated[
    Literal["auto", "mcap", "zarr", "lerobot", "robomimic", "parquet"],
    typer.Option("--format", help="Layout of the recordings."),
]
Recordings = Annotated[Path, typer.Argument(help="File or folder of recordings.", metavar="PATH")]
Contract = Annotated[
    Path | None, typer.Option(help="contract.yaml; proposed from the data if absent.")
]
TaskName = Annotated[
    str | None, typer.Option("--task", help="Name of the task; for MCAP, of a registered one.")
]
IMPORT_EXAMPLES = examples(
    "genpolicy propose recordings/ --out contract.yaml",
    "genpolicy ingest recordings/ --contract contract.yaml --out dataset/",
    "genpolicy ingest pusht_cchi_v7_replay.zarr --out dataset/",
)
REPLAY_EXAMPLES = examples(
    "genpolicy replay artifacts/shadow/journal.mcap \\",
    "    --session flow/held_out/11 --out rejected.mcap",
)

EXPORT_EXAMPLES = examples("genpolicy export lerobot artifacts/ingest --out lerobot/")
ROLLOUT_EXAMPLES = examples(
    "genpolicy export rollout flow/push/0 --to gif --out push.gif",
    "genpolicy export rollout flow/push/0 --to foxglove --out push.mcap",
)
RECORDING_EXAMPLES = examples("genpolicy export recording recordings/one.mcap --out watch.mcap")
SERVE_EXAMPLES = examples(
    "genpolicy serve-policy artifacts/train_generators/flow/seed_0 --port 8000"
)
HOST_EXAMPLES = examples("genpolicy serve-candidate candidate.yaml --port 8000")
TORCH_EXAMPLES = examples(
    "genpolicy export torch artifacts/train_generators/flow/seed_0 --out policy.pt2",
    "genpolicy export torch artifacts/train_generators/flow/seed_0 --out sampler.pt2 \\",
    "    --encoder encoder.pt2",
)
ONNX_EXAMPLES = examples(
    "genpolicy export onnx artifacts/train_generators/flow/seed_0 --out policy.onnx",
)
CHECK_EXAMPLES = examples(
    "genpolicy check-candidate candidate.yaml",
    "genpolicy check-candidate candidate.yaml --json > checked.json",
    "genpolicy check-candidate candidate.yaml --earlier checked.json",
)


def program(arguments: Sequence[str]) -> int:
    """Run `genpolicy`; returns the exit code."""
    app = new_app(DESCRIPTION, cls=Registered)
    app.command("propose", epilog=IMPORT_EXAMPLES)(propose)
    app.command("ingest", epilog=IMPORT_EXAMPLES)(ingest)
    app.command("fixtures", epilog=examples("genpolicy fixtures --pin"))(fixtures)
    app.command("replay", epilog=REPLAY_EXAMPLES)(replay)
    exports = new_app("Write a dataset, a checkpoint or a rollout for others.")
    exports.callback()(lambda: None)
    exports.command("lerobot", epilog=EXPORT_EXAMPLES)(export_lerobot)
    exports.command("rollout", epilog=ROLLOUT_EXAMPLES)(export_rollout)
    exports.command("recording", epilog=RECORDING_EXAMPLES)(export_recording)
    exports.command("torch", epilog=TORCH_EXAMPLES)(export_torch)
    exports.command("onnx", epilog=ONNX_EXAMPLES)(export_onnx)
    app.add_typer(exports, name="export")
    app.command("serve-policy", epilog=SERVE_EXAMPLES)(serve_policy)
    app.command("serve-candidate", epilog=HOST_EXAMPLES)(serve_candidate)
    app.command("check-candidate", epilog=CHECK_EXAMPLES)(check_candidate)
    app.command("doctor", epilog=examples("genpolicy doctor --json"))(doctor)
    return run_program(app, "genpolicy", arguments)


def propose(
    path: Recordings,
    out: Annotated[Path, typer.Option(help="contract.yaml to write.")],
    layout: Format = "auto",
    task: TaskName = None,
    force: Annotated[bool, typer.Option("--force", help="Replace an old contract.yaml.")] = False,
) -> int:
    """Propose an import's contract, for a person to correct."""
    from genpolicy.cli.beforehand import check_file, check_import

    check_import(path, out, format=layout, contract=None)
    check_file(out, force=force)
    from genpolicy.cli.ingest import run_propose

    return run_propose(path, out=out, format=layout, task=task)


def ingest(
    path: Recordings,
    out: Annotated[Path, typer.Option(help="Dataset folder to write.")],
    layout: Format = "auto",
    contract: Contract = None,
    task: TaskName = None,
    as_json: AsJson = False,
) -> int:
    """Convert recordings to a verified dataset.

    Every episode is accepted, or refused by name with row and reason.
    """
    from genpolicy.cli.beforehand import check_folder, check_import, refuse_dataset

    if check_import(path, out, format=layout, contract=contract) == "dataset":
        refuse_dataset(path)
    check_folder(out, "manifest.json", "dataset")
    from genpolicy.cli.ingest import Recordings, run_ingest

    source = Recordings(path, format=layout, contract=contract, task=task)
    return run_ingest(source, out=out, as_json=as_json)


def fixtures(
    pin: Annotated[bool, typer.Option("--pin", help="Pin them as they are now.")] = False,
    task: TaskName = None,
    root: Annotated[Path, typer.Option(help="The workspace.")] = Path(),
) -> int:
    """Compare the fixtures with their pins, or pin them.

    Fixtures are controller, limits, supervisor, robot and scene; the pins stand
    in fixtures.yaml. Exit 2 if one is not as pinned. The ladder stops for the same reason.
    """
    from genpolicy.cli.fixtures import run_fixtures

    return run_fixtures(root, task=task, write=pin)


def replay(
    journal: Annotated[Path, typer.Argument(help="Journal of shadow or stress.")],
    out: Annotated[Path, typer.Option(help="MCAP file to write.")],
    session: Annotated[
        str | None, typer.Option(help="Which one; needed where the journal has several.")
    ] = None,
    task: TaskName = None,
    force: Annotated[bool, typer.Option("--force", help="Replace an old file.")] = False,
) -> int:
    """Write a journal's session for Foxglove.

    The messages of the session are copied, and beside them stands what they
    say: scene, arm, the action commanded, the chunk proposed, proposals that
    were rejected with the reason, and a log. The journal is only read.
    """
    from genpolicy.cli.replay import run_replay

    return run_replay(journal, out, session=session, task=task, force=force)


def export_lerobot(
    dataset: Annotated[Path, typer.Argument(help="A verified dataset.", metavar="DATASET")],
    out: Annotated[Path, typer.Option(help="Folder to write.")],
    split: Annotated[
        Literal["train", "validation", "test"], typer.Option(help="Which episodes.")
    ] = "train",
) -> int:
    """Write a split as a LeRobotDataset v3.0.

    The training split, unless another one is named: who trains on it cannot
    have seen what a candidate is held against. Only successes, where outcomes
    are recorded.
    """
    from genpolicy.cli.beforehand import check_folder
    from genpolicy.data.exports.lerobot import PROVENANCE

    check_folder(out, PROVENANCE, "export")
    from genpolicy.cli.exporting import run_export_lerobot

    return run_export_lerobot(dataset, out, split=split)


def export_rollout(
    rollout: Annotated[str, typer.Argument(help="METHOD/CONDITION/START.", metavar="ROLLOUT")],
    out: Annotated[Path, typer.Option(help="File to write.")],
    to: Annotated[Literal["foxglove", "gif", "rerun"], typer.Option(help="In which form.")],
    root: Annotated[Path, typer.Option(help="The workspace.")] = Path(),
    task: TaskName = None,
    force: Annotated[bool, typer.Option("--force", help="Replace an old file.")] = False,
) -> int:
    """Write a rollout of Gate D to be watched.

    For Foxglove or Lichtblick as `genpolicy replay` does, with its layout; as a
    GIF, from above and from the side; or for Rerun, which needs the extra rerun.
    """
    from genpolicy.cli.rollouts import run_export_rollout

    return run_export_rollout(rollout, out, to=to, root=root, task=task, force=force)


def export_recording(
    recording: Annotated[Path, typer.Argument(help="An MCAP recording.", metavar="RECORDING")],
    out: Annotated[Path, typer.Option(help="MCAP file to write.")],
    force: Annotated[bool, typer.Option("--force", help="Replace an old file.")] = False,
) -> int:
    """Write a recording for Foxglove or Lichtblick.

    Its messages are copied byte for byte; its schemas are said in the plain
    types that both read. The recording is only read.
    """
    from genpolicy.cli.replay import run_export_recording

    return run_export_recording(recording, out, force=force)


Checkpoint = Annotated[Path, typer.Argument(help="Folder of a checkpoint.")]
Encoder = Annotated[
    Path | None,
    typer.Option(help="A file of its own for the encoder, so that its time is known."),
]
Replace = Annotated[bool, typer.Option("--force", help="Replace old files.")]


def export_torch(
    checkpoint: Checkpoint,
    out: Annotated[Path, typer.Option(help="File to write, policy.pt2.")],
    encoder: Encoder = None,
    force: Replace = False,
) -> int:
    """Write a checkpoint as a torch.export program.

    Normalisation and every step of its sampler are in it; observation and noise go in, actions
    come out. It holds no pickle. What an entry of kind torch says of it is printed.
    """
    from genpolicy.cli.programs import run_export_program

    return run_export_program(checkpoint, out, kind="torch", encoder=encoder, force=force)


def export_onnx(
    checkpoint: Checkpoint,
    out: Annotated[Path, typer.Option(help="File to write, policy.onnx.")],
    encoder: Encoder = None,
    force: Replace = False,
) -> int:
    """Write a checkpoint as an ONNX file.

    As `export torch`, for an entry of kind onnx. Needs the extra onnx.
    """
    from genpolicy.cli.programs import run_export_program

    return run_export_program(checkpoint, out, kind="onnx", encoder=encoder, force=force)


def serve_policy(
    checkpoint: Annotated[Path, typer.Argument(help="Folder of a checkpoint.")],
    port: Annotated[int, typer.Option(min=0, max=65535, help="Port; 0 for a free one.")] = 8000,
    sha256: Annotated[
        str | None, typer.Option(help="What the checkpoint must be; any if absent.")
    ] = None,
    device: Annotated[str, typer.Option(help="Torch device that it runs on.")] = "cpu",
) -> int:
    """Serve a checkpoint over openpi's protocol.

    On this machine, until an interrupt. WebSocket and msgpack: metadata first, then one answer
    for each message; see docs/candidates.md.
    """
    from genpolicy.cli.serving import run_serve

    return run_serve(checkpoint, port=port, sha256=sha256, device=device)


def serve_candidate(
    entry: Annotated[Path, typer.Argument(help="The candidate's entry, a YAML file.")],
    port: Annotated[int, typer.Option(min=0, max=65535, help="Port; 0 for a free one.")] = 8000,
    sha256: Annotated[
        str | None, typer.Option(help="What the entry must say; anything if absent.")
    ] = None,
    width: Annotated[
        list[str] | None, typer.Option(help="NAME=NUMBER: how wide an input is.")
    ] = None,
    threads: Annotated[
        int | None,
        typer.Option(min=1, max=256, help="Of a program's operators; as the entry says if absent."),
    ] = None,
    observation: Annotated[
        str | None, typer.Option(help="Hash of the observation contract in force.")
    ] = None,
    check: Annotated[bool, typer.Option("--check", help="Load it only, and end.")] = False,
) -> int:
    """Host the candidate of an entry.

    Of kind trained, torch, onnx or scripted. On this machine, until an interrupt,
    over openpi's protocol. `check-candidate` and the ladder start it themselves,
    in a process of its own.
    """
    from genpolicy.cli.serving import run_host

    return run_host(
        entry, port=port, sha256=sha256, widths=width or [], threads=threads,
        observation=observation, only_loaded=check,
    )  # fmt: skip


def check_candidate(
    entry: Annotated[Path, typer.Argument(help="The candidate's entry, a YAML file.")],
    dataset: Annotated[Path, typer.Option(help="Verified dataset.")] = Path("artifacts/ingest"),
    candidates: Annotated[int, typer.Option(min=1, max=64, help="Chunks of an invocation.")] = 8,
    deadline_s: Annotated[
        float, typer.Option("--deadline", min=1e-3, max=60.0, help="Seconds an answer may take.")
    ] = 0.15,
    earlier: Annotated[
        Path | None, typer.Option(help="Report of an earlier check, to compare with.")
    ] = None,
    as_json: AsJson = False,
) -> int:
    """Check a policy of your own, of any kind.

    It is asked about recorded moments of held-out episodes: whether it answers,
    repeats itself, starts anew as the same, means the units that it declares,
    looks at what it is given, and is in time. Nothing moves. Exit 3 if
    something fails.
    """
    from genpolicy.cli.candidates import CheckOptions, run_check

    options = CheckOptions(dataset, candidates, deadline_s, earlier)
    return run_check(entry, options, as_json=as_json)


def doctor(
    as_json: AsJson = False,
    root: Annotated[Path, typer.Option(help="The checkout.")] = Path(),
) -> int:
    """Check this machine and this environment. Exit 2 if something is wrong."""
    from genpolicy.doctor import report

    return report(root, as_json=as_json)
