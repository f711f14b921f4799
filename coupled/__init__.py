"""Fly a JSBSim aircraft through a compliant control loader.

`coupled.rig` is the loader, `coupled.flight` couples it to an aircraft,
`coupled.authority.compare` compares what each correction gives back.
"""

__version__ = "0.1.0"
