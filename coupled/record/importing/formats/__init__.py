"""The formats of logs that are read in a process of their own, a module each.

Each takes the whole file as bytes and returns its columns of numbers. None executes content of a
file, opens other files that it names, or allocates more than it holds.
"""
