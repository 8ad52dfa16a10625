"""`tcstudy report`: a result file as one HTML page that needs no network, from the stored data
alone.

`run` reads what is kept and picks what the page of a run shows; `write` makes the sections of all
others, of `parts` from the panels of the pictures and the tables of the terminal, and puts it
together with the scripts in `assets`. What a node does, what a cycle changes and what speaks
against a fit stand in the data: scripts have no rules of their own.
"""
