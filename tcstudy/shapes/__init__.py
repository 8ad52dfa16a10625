"""Plane outlines: edges and arcs, loops, lengths, areas, points in a body, and what can be wrong with them.

Not here: meshes (fem), names of YAML keys (read).
"""
