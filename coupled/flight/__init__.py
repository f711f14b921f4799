"""The rig coupled to an aircraft: airframe, pilots, scenario, and the frame loop."""
