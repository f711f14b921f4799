"""The gap between a rig's simulation and its records: where it lies, which effect causes it."""
