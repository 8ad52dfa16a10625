"""Tables, pictures and pages from stored data, and the progress of a run.

Not here: any solve; what a report shows stands in a file.
"""
