"""A search over sets of effects by their evidence, beside the one that diagnoses use (issue 36)."""
