"""Stages that stand beside the ladder, and where in `params.yaml` their settings stand."""

BESIDE = {"failure_search": "card.failure_search"}
