"""Error measures on plain meshes: norms, rates and the orders to expect, corner exponents, transfer
between meshes, and what data and drawn points say (`fitted`, `indices`).

Not here: estimating an error without knowing the solution (refine).
"""
