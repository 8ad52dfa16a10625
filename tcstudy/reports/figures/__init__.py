"""Pictures: of a point, a law, a mesh, a sweep, a path, a history, a fit, of errors and costs.

Not here: which numbers a table has (terminal), pages for a browser (page).
"""
