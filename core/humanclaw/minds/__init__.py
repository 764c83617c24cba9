"""Minds: what a model is told of a body, and the gym in which it is trained. Their door is `humanclaw`."""
