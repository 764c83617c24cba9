"""Prompts and memory of models. Import their public names from `humanclaw`."""
