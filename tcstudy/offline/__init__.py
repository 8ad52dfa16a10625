"""A mesh and a material to plain arrays: Ã, basis loads and temperatures, each computed once for a whole sweep.

Not here: friction, sweeps and points, files.
"""
