"""Plane outlines: edges and arcs, loops, lengths, areas, points in a body, and what can be wrong
with them; areas, gradients and recovered gradients of the triangles of a mesh.

Not here: making meshes (fem), names of YAML keys (read).
"""
