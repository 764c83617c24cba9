"""Tasks, rewards and conversations to train agents with. Import their public names from `humanclaw`."""
