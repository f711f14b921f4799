"""The independent twin: its own loader and effects, by other methods than the rig's stages."""
