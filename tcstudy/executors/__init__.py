"""Who does the work: this process, workers beside it, or a dask cluster; what becomes of a worker
that dies.

Each is a concurrent.futures.Executor: `submit(function, *arguments)` gives a Future, whether the
function solves a block of points or a whole geometry. A Job tells in addition how the call is named
and how long it may take. An executor writes nothing and knows no study; a worker imports
tcstudy.contact and what the function needs.

Not here: which points form a block, what is recorded of them (study); how to solve them (contact).
"""
