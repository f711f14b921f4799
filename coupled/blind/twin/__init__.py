"""The independent twin: a second implementation of loader and effects, without the rig's stages."""
