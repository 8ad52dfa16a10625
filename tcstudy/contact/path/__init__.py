"""Solutions along a parameter in which the load is affine: one path, or proved all branches.

Not here: what a study says of a path (scene), the parameter it follows (study), files (data).
"""
