"""What control authority is lost: configurations compared, maps, and where a rig is stable."""
