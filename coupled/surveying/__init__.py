"""The available JSBSim models: trim, motion of the controls, and draft rigs."""
