"""How an episode is played: bodies, the episode that anyone can step, the loop. `humanclaw` shows their names."""
