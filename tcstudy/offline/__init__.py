"""From a mesh and a material to plain arrays, and from a solution back to the mesh.

Ã, basis loads and temperatures are computed once for a whole sweep. Requested quantities, section
forces and proved bounds of a solution need the mesh again.

Not here: contact problems (contact), sweeps and points (study), files.
"""
