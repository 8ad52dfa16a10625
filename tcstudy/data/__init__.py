"""What is kept: records, one table of variables, one writer, the journal of finished points.

Not here: computing a number, printing it.
"""
