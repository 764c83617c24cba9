"""Tasks for hands: an extension of the benchmark, apart from the paper's split. Needs the extra `hands`."""
