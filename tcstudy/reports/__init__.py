"""Tables, pictures and pages from stored data, and the progress of a run.

Here: what is read from a file for any of these, and words for numbers. `terminal`: tables and
sentences; `figures`: pictures; `page`: pages for a browser; `export`: files for other programs;
each may use those before it. Not here: any solve; what a report shows stands in a file.
"""
