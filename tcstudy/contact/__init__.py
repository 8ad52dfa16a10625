"""Contact problems on plain arrays, one or many on one body at once: solvers, certificates, paths of solutions.

problem, extended   the problem and the test that judges its solutions, in one and in two doubles
contact             the door: a solver by name, all starts, the judgement
separable/          the default method; bundle/ the general one; loop.py runs both
search, hulls, moves  less energy than descent finds
bounds, certificates  what is proved of a solution
block, every        many problems of one body at once; body, newton, descent, certify serve them
path/               equilibria on one branch along a parameter
history/            steps of a load history with memory

Not here: where Ã and l̃ come from (offline), files.
"""
