"""Tasks with a partner in a second body: an extension of the benchmark, apart from the paper's split."""
