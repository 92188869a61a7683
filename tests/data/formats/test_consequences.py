"""What comes of an episode is told by its name, in every part of it; what may be why is not."""

import pytest

from genpolicy.data.formats.consequences import counts_rows, is_called_measured, may_be_reason


@pytest.mark.parametrize(
    "name",
    ["task_index", "subtask_index", "scenario", "hand", "latent", "collector", "q7_Ω", "k",
     "next_goal", "next_target", "done_by", "rod_length", "tool_length", "return_bin", "side_mask",
     "mask_colour", "score_sheet", "truncated_rod", "length_class", "observation.return_bin",
     "end_effector", "end_effector_pose[3]", "end_tool", "last_name", "last_operator",
     "final_goal", "final_target_position", "terminal_id", "tool.length", "mask/lamp_on",
     "mask/better", "num_objects", "sample_number", "goal.frame", "goal/index", "time_of_day",
     "rod_length_m", "ep_meta.lang", "episode.side", "episode.r2d2", "failure_mode",
     "steel_grade", "start_time",
     "n_objects", "max_force", "force_limit", "max_speed", "error_code", "calibration_error",
     "collision_model", "retry", "goal_error", "prob", "confidence",
     "rod_len", "rope_path_kind", "stop_position_mm", "info/side", "max_steps", "time_limit"],
)  # fmt: skip
def test_a_name_does_not_keep_a_column_from_being_a_reason(name):
    assert may_be_reason(name)


@pytest.mark.parametrize(
    "name",
    ["index", "frame_index", "episode_index", "timestamp", "reward", "next.done", "next.success",
     "dataset_from_index", "is_terminal", "success", "length", "episode_length", "is_success",
     "sparse_reward", "cumulative_reward", "success_rate", "total_score", "ep_return", "next",
     "next.reward", "action_mask", "pad_mask", "reward_0", "task_success", "observation.done",
     "success/stage1", "rewards/lifted", "rewards.reach", "outcome.reason", "failure_reason",
     "terminations/time_out", "time_out", "metrics/path", "stats/action/max", "episode_stats[0].r",
     "info/return", "meta/length", "metrics/episode_length", "infos/score", "info/duration",
     "meta/episode_return", "episode.r", "info/episode.l", "episode/t", "mask/failure",
     "mask/failed", "mask/successes", "fail", "demo_grade", "operator_rating", "video_quality",
     "reward_terms", "duration_s", "length_ms", "num_steps", "total_frames", "n_samples",
     "elapsed_time", "elapsed_time_s", "episode_steps", "end_time", "end_time_s", "last_frame",
     "final_pose", "final_state", "final_state[0]", "meta/final_state", "final_cup_position",
     "terminal_state", "last_distance", "info/frame_index",
     "n_collisions", "collision_count", "number_of_attempts", "retries_total", "tracking_error",
     "rms_position_error_mm", "success_prob", "success_probability", "num_interventions",
     "path_length", "ep_len", "traj_len", "timeout", "completion_time", "truncations", "nb_frames"],
)  # fmt: skip
def test_what_counts_or_judges_is_no_reason(name):
    assert not may_be_reason(name)


@pytest.mark.parametrize(
    ("name", "measured"),
    [("max_force", True), ("info/peak_contact_force_n", True), ("mean_tcp_speed_m_s", True),
     ("total_energy", True), ("max_torque[3]", True), ("max_accel_m_s2", True),
     ("force", False), ("max_payload", False), ("max_force_policy", False),
     ("speed", False), ("mean", False), ("0", False)],
)  # fmt: skip
def test_statistics_of_motion_and_load_are_told_by_their_names(name, measured):
    assert is_called_measured(name) is measured


def test_what_a_layout_numbers_is_no_judge():
    assert counts_rows("index") and counts_rows("episode_index") and counts_rows("info/frame_index")
    assert not any(map(counts_rows, ("next.reward", "num_steps", "task_index", "goal.index")))
