"""Which mesh comes next: families of meshes, error estimates, goals and their tolerances.

Not here: the loop over levels and points (study), weak forms (fem).
"""
