"""Words and JSON: nearest names, text that is safe to print, strict JSON, notebook cards."""
