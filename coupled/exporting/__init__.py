"""A rig's loaders as systems that JSBSim itself runs, with the aircraft around them."""
