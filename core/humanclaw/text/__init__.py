"""Words: names that were meant, texts that a terminal can show, JSON as its author wrote it."""
