"""Contact problems on plain arrays, one or many on one body at once: solvers, certificates, paths
of solutions.

problem             the problem, one or rows of them on one body, and the test of its solutions
extended            that test in two doubles
solution            the exact solution on the pieces that a point is on, and its derivatives
solve               the doors for one problem and for many of one body: all starts, the judgement
newton, descent     Newton's equations and the convex model; from a start to a minimum
search              starts from which descent finds less energy
certificates        what is proved of a solution
loose_body          motions of a body that contact alone holds: what moves it away, how far at most
all_solutions       all solutions of small problems
boxes               boxes that hold all solutions, made smaller by proof
curves, soft_modes  parts with one solution or one curve, ties; the search on fine meshes
simplex_qp, bundle  the published method for any locally Lipschitz function
path/               equilibria on one branch along a parameter
history/            steps of a load history with memory

Not here: where Ã and l̃ come from (offline), files.
"""
