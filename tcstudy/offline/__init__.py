"""A mesh and a material to plain arrays: Ã, basis loads and temperatures, each computed once for a
whole sweep; and what of a solution asks for the mesh again: numbers on request, section forces,
proved bounds.

Not here: contact problems (contact), sweeps and points (study), files.
"""
