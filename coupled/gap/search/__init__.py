"""The search: sets of effects, fitted as physics, and compared by their evidence."""
