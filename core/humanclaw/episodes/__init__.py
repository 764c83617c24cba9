"""How an episode is played: bodies, the episode that anyone can step, and the loop. Its names are those of `humanclaw`."""
