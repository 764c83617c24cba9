"""Measures of what was learned: fidelity, naturalness, speed and pictures."""
