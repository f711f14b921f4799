"""The inputs and outputs of each stage in a record, and their noise floors."""
