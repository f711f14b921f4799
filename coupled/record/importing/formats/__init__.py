"""The formats of logs that are read in a process of their own, a module each.

Each takes the whole file as bytes and returns its columns of numbers. None runs what a file says,
opens another file that it names, or reads more than it holds.
"""
