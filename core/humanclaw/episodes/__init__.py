"""Play an episode: bodies, the steppable Episode, the loop. Import their public names from `humanclaw`."""
