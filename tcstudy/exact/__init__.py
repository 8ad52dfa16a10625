"""Chosen exact solutions: the loads that belong to them, their checks, their numbers and energies.

Not here: solving anything; comparing levels with them (study).
"""
