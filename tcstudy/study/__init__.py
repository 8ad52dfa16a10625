"""Points and levels: the run and its users (convergence, cost, path), the plan before it, the file after it.

Not here: numerics of a single point (offline, solve, online), text for people (report).
"""
