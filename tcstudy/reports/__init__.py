"""Tables, pictures and pages from stored data, and the progress of a run.

Here: readers of files that several of these use, and words for numbers. `terminal`: tables and
sentences; `export`: files for other programs; `figures`: pictures; `page`: pages for a browser.
Each may use those before it. Not here: any solve; what a report shows stands in a file.
"""
