"""Studies on a task: matched training, reload, latency, shadow and stress evidence."""
