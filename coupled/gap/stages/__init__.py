"""The residual of each stage: the measured output minus the prediction from the measured input."""
