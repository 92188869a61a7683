"""Checkpoints of ours as programs that other runtimes run, with their samplers written out."""
