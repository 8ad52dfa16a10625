"""Points and levels: runs, convergence, cost, paths, histories and fits, the plan before, the file
after.

Not here: numerics of a single point (offline, contact), text for people (reports).
"""
