"""Wrongs in the recordings, their labels, and leaks between the splits: gate A."""

import uuid
from dataclasses import replace
from pathlib import Path

import numpy as np

from benchmarks.ladder_truth.outcome import Expected
from benchmarks.ladder_truth.planting import (
    Wrong,
    patched,
    recordings,
    side_of,
    with_metadata,
    with_stream,
    with_values,
)
from benchmarks.ladder_truth.workspace import BROUGHT
from genpolicy.data.recording.episode import RecordedEpisode
from genpolicy.data.recording.reader import read_episode
from genpolicy.data.recording.writer import write_episode

LATE_EPOCH = "epoch_3"
MS = 1_000_000
ASSEMBLE, DATASET = "genpolicy/data/assemble.py", "genpolicy/data/dataset.py"


def _robot_clock(episode: RecordedEpisode) -> RecordedEpisode:
    if episode.metadata["calibration_epoch"] != LATE_EPOCH:
        return episode
    return with_stream(
        episode, "robot", lambda s: replace(s, event_time_ns=s.event_time_ns - 80 * MS)
    )


def _millimetres(episode: RecordedEpisode) -> RecordedEpisode:
    def change(values: np.ndarray) -> np.ndarray:
        values[:, :3] *= 1000.0
        return values

    return with_values(episode, "robot", change)


def _mirrored(episode: RecordedEpisode) -> RecordedEpisode:
    def change(values: np.ndarray) -> np.ndarray:
        values[:, 1] *= -1.0
        return values

    return with_values(episode, "robot", change)


def _camera_moved(episode: RecordedEpisode) -> RecordedEpisode:
    def change(values: np.ndarray) -> np.ndarray:
        values[:, 0] += 0.012
        return values

    late = episode.metadata["calibration_epoch"] == LATE_EPOCH
    return with_values(episode, "camera", change) if late else episode


def _late_actions(episode: RecordedEpisode) -> RecordedEpisode:
    def change(values: np.ndarray) -> np.ndarray:
        return np.concatenate([np.repeat(values[:1], 2, axis=0), values[:-2]])

    late = episode.metadata["calibration_epoch"] == LATE_EPOCH
    return with_values(episode, "action", change) if late else episode


def _half_gain(episode: RecordedEpisode) -> RecordedEpisode:
    def change(values: np.ndarray) -> np.ndarray:
        values[:, :3] = values[:1, :3] + 0.5 * (values[:, :3] - values[:1, :3])
        return values

    late = episode.metadata["calibration_epoch"] == LATE_EPOCH
    return with_values(episode, "robot", change) if late else episode


def _operator_by_side(episode: RecordedEpisode) -> RecordedEpisode:
    operator = "cedar" if side_of(episode) == "left" else "birch"
    return with_metadata(episode, operator=operator)


def _copies(workspace: Path) -> None:
    """Fifteen early recordings once more, rounded elsewhere, as the newest: in the test split."""
    paths = sorted((workspace / BROUGHT).glob("*.mcap"))
    newest = read_episode(paths[-1]).streams["action"].event_time_ns[-1]
    for number, path in enumerate(paths[:15]):
        episode = read_episode(path)
        late = int(newest - episode.streams["action"].event_time_ns[0]) + (number + 1) * 60_000 * MS
        streams = {
            name: replace(
                s,
                event_time_ns=s.event_time_ns + late,
                receive_time_ns=s.receive_time_ns + late,
                values=np.array(s.values) + (1e-6 if name == "force" else 0.0),
            )
            for name, s in episode.streams.items()
        }
        phases = tuple((e + late, r + late, p) for e, r, p in episode.phase_events)
        name = str(uuid.uuid5(uuid.NAMESPACE_OID, episode.episode_uuid))
        copy = replace(episode, episode_uuid=name, streams=streams, phase_events=phases)
        write_episode(workspace / BROUGHT / f"episode_9{number:04d}.mcap", copy)


def _successful(episode: RecordedEpisode) -> RecordedEpisode:
    return with_metadata(episode, outcome="success")


def _failed(episode: RecordedEpisode) -> RecordedEpisode:
    return with_metadata(episode, outcome="failure")


def _left(episode: RecordedEpisode) -> RecordedEpisode | None:
    return episode if side_of(episode) == "left" else None


A = "A"
DEFECT = ("data_defects", "cause_accepted")
WRONGS = (
    Wrong("clock_of_an_epoch", "data",
          "In one epoch the robot's stamps run 80 ms early, and nobody declared it.",
          "brought", recordings(_robot_clock),
          Expected(A, ("clock_residual_s", "lag_spread_rows", *DEFECT))),
    Wrong("positions_in_millimetres", "data",
          "Every observed position is in mm where the contract says m.",
          "brought", recordings(_millimetres),
          Expected(A, refusal=r"ingest: .*(range|unit|accepted|episodes)")),
    Wrong("mirrored_positions", "data",
          "The observed lateral axis points the other way than the commands'.",
          "brought", recordings(_mirrored), Expected(A, DEFECT)),
    Wrong("camera_moved", "data",
          "In one epoch the camera stands 12 mm beside its calibration.",
          "brought", recordings(_camera_moved), Expected(A, ("calibration_residual_m", *DEFECT))),
    Wrong("actions_two_steps_late", "data",
          "In one epoch actions were logged two steps late.",
          "brought", recordings(_late_actions), Expected(A, ("lag_spread_rows", *DEFECT))),
    Wrong("half_the_gain", "data",
          "In one epoch the observed motion is half of the commanded one.",
          "brought", recordings(_half_gain),
          Expected(A, ("lag_spread_rows", "calibration_residual_m", *DEFECT))),
    Wrong("twelve_recordings", "data", "There are only twelve demonstrations.",
          "brought", recordings(lambda episode: None, only=lambda number: number >= 12),
          Expected(A, ("held_out_situations", "multimodal_situations", "cause_accepted"))),
    Wrong("one_mode_only", "data", "Everybody passes on the left: there is one way, not two.",
          "brought", recordings(_left),
          Expected(A, ("multimodal_situations", "cause_accepted"))),
    Wrong("operator_decides_the_side", "data",
          "Who demonstrates decides the side, and the policy does not see who.",
          "brought", recordings(_operator_by_side),
          Expected(A, ("strata_effect", "told_share", "cause_accepted"))),
    Wrong("failures_called_success", "labels", "Every failed demonstration is labelled success.",
          "brought", recordings(_successful), Expected(A, ("label_disagreement", *DEFECT))),
    Wrong("successes_called_failure", "labels", "Every fifth recording is labelled a failure.",
          "brought", recordings(_failed, only=lambda number: number % 5 == 0),
          Expected(A, ("label_disagreement", *DEFECT))),
    Wrong("unknown_outcome", "labels", "Outcomes are written as `ok`, which is no label.",
          "brought", recordings(lambda episode: with_metadata(episode, outcome="ok")),
          Expected(A, refusal=r"ingest: .*(outcome|accepted|episodes)")),
    Wrong("another_task", "labels", "The recordings are of another task, by their own metadata.",
          "brought", recordings(lambda episode: with_metadata(episode, task="drawer_opening")),
          Expected(A, DEFECT, refusal=r"task")),
    Wrong("copies_in_the_test_split", "leakage",
          "Fifteen training episodes are there once more, as the newest: in the test split.",
          "brought", _copies, Expected(A, DEFECT)),
    Wrong("statistics_of_all_splits", "leakage",
          "The writer computes the normalisation from all splits, not from training alone.",
          "brought",
          patched(ASSEMBLE, (
              "rows.observation for rows in training", "e.rows.observation for e in episodes")),
          Expected(A, refusal=r"normalisation")),
    Wrong("statistics_of_all_splits_everywhere", "leakage",
          "Writer and reader agree on a normalisation from all splits.",
          "brought",
          lambda workspace: [
              patched(ASSEMBLE, (
                  "rows.observation for rows in training", "e.rows.observation for e in episodes"),
              )(workspace),
              patched(DATASET, (
                  "statistics_of(training.observation)", "statistics_of(dataset.frames.observation)"
              ))(workspace),
          ],
          Expected(A, DEFECT, refusal=r"normalisation")),
    Wrong("splits_not_in_time", "leakage",
          "Splits are dealt by identifier, not in time: the future trains the policy.",
          "brought",
          patched("genpolicy/data/split.py",
                  ("(recorded_at_ns[i], uuids[i])", "(uuids[i], recorded_at_ns[i])")),
          Expected(A, DEFECT, refusal=r"split")),
    Wrong("validation_trains", "leakage",
          "Windows of the validation split are among the training windows.",
          "brought",
          patched("genpolicy/policies/matched_training.py",
                  ('training_windows(data, "train", horizons, episodes=job.episodes)',
                   'training_windows(data, "validation", horizons)')),
          Expected(A, ("baselines_matched",), refusal=r"training split|windows")),
)  # fmt: skip
