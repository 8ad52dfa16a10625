"""Solutions along a parameter in which the load is affine, followed piece by piece; all branches of
a range, by proof.

Not here: what a study says of it (scene), in which number a load is affine (study), files (data).
"""
