"""YAML to Study: documents with marks, one reader a section, every fault with its line and remedy.

Not here: what a record means (scene), checks that need a mesh (study), any number that is computed
from a solution.
"""
