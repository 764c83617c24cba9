"""The motion model on torch: its definition, loss, checkpoints and generator."""
