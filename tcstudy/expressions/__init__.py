"""Text in x and y to a tree, its values and its derivatives.

Not here: YAML, bodies, units. Text is parsed, never evaluated as code.
"""
