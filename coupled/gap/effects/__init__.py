"""The library of effects: what a rig may have and its nominal model lacks."""
