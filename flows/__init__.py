"""How the ladder is driven: one `dvc repro`, a separate workspace, or Prefect flows over DVC."""
