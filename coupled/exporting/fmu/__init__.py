"""Export of a control's loader as an FMU for co-simulation."""
