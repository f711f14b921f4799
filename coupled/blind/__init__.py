"""For developers of the diagnosis: sealed records of an independent twin of the rig, and scores.

`coupled blind` measures how accurate `coupled.gap` is. Simulation and diagnosis need nothing of
this package.
"""
