"""Measures of what was learned: fidelity, naturalness, and the paper's figures."""
