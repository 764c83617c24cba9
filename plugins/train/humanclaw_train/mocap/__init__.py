"""Motion capture: readers of its formats, and retargeting to the body of humanclaw."""
