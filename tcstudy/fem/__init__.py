"""NGSolve and Netgen: geometry, meshes, weak forms, recovered stresses; no other room imports them.

Not here: solving; what comes out is plain arrays.
"""
