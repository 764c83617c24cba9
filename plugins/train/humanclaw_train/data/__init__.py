"""Training data: chunks of clips, their curation, and what a run reads of them."""
