"""The rig coupled to an aircraft: airframe, pilots, manoeuvre, run file, and the frame loop."""
