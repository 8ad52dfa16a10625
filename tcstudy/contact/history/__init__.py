"""Load histories on plain arrays: a step is one contact problem whose laws remember, node by node.

Not here: what a study says of it (scene/histories.py), which loads follow each other, files (study,
data).
"""
