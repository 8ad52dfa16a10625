"""Points and levels: the run and its users (convergence, cost, path), the plan before it, the file after it.

Not here: numerics of a single point (offline, contact), text for people (report).
"""
