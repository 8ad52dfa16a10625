"""The separable Newton method, which knows the exact pieces of b at every node, and what it is made of.

pieces.py and finish.py serve every other solver, too. Not here: starts, the search for less energy (solvers).
"""
