"""Contact problems on plain arrays, one or many on one body at once: solvers, certificates, paths of solutions.

problem             the problem, one or rows of them on one body, and the test of its solutions
extended, active_set  that test in two doubles; from an approximate solution to an exact one, in one or in two
contact, block      the doors for one problem and for many of one body: all starts, the judgement
descent, newton, convex_step  from a start to a minimum; bundle/ the general method
search, envelopes   starts from which descent finds less energy
linearised, factors how a solution moves with its data; factors of parts of Ã
bounds, certificates  what is proved of a solution
all_solutions, boxes  all solutions of small problems
path/               equilibria on one branch along a parameter
history/            steps of a load history with memory

Not here: where Ã and l̃ come from (offline), files.
"""
