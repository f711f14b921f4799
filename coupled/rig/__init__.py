"""The control-loading rig: its data and its physics, one module for each stage of the chain."""
