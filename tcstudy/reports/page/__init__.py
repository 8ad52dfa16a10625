"""`tcstudy report`: a result file as one HTML page that needs no network, from the stored data alone.

`stored` reads what is kept; `run` picks what the page of a run shows; `kinds` makes the sections of all others, of
`parts` from the panels of the pictures and the tables of the terminal, with their numbers packed; `write` puts it
together with the scripts in `assets`. What a node does, what a cycle changes and what speaks against a fit stand in the
data: the scripts draw and have no rules of their own.
"""
