"""Synthetic motion for the parameter ranges that clips do not fill."""
