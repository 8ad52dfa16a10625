"""How accurate a discrete solution is: nested meshes, error norms, rates, corner exponents; plain arrays only."""
