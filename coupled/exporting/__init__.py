"""Export of a rig's loaders as JSBSim systems, with the aircraft that includes them."""
