"""The JSBSim models that are here: whether they trim, how their controls move, a first rig."""
