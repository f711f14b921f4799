"""The control-loading rig: its data and its physics, one module a stage of the signal chain."""
