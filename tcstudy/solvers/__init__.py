"""One contact problem on plain arrays: solvers, search for less energy, certificates, paths of solutions.

Not here: where Ã and l̃ come from (offline), many problems at once (online), files.
"""
