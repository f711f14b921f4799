"""The independent twin: another program's loader and effects, none of the rig's stages."""
