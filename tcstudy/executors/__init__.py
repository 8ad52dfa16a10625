"""Executors of the work: this process, workers beside it, or a dask cluster.

Each is a concurrent.futures.Executor: `submit(function, *arguments)` gives a Future, whether the
function solves a block of points or a whole geometry. A Job has in addition the name of the call
and the time that it may take. If a worker dies its call is tried again. An executor writes nothing
and knows no study; a worker imports tcstudy.contact and the modules that the function needs.

Not here: which points form a block, the record of them (study); how to solve them (contact).
"""
