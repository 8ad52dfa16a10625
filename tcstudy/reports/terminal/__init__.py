"""What stands on the terminal: tables, summaries and sentences, the progress of a run, streams that
stop no work.

Not here: pictures (figures), files for other programs (export).
"""
