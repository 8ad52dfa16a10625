"""What a study is: frozen records in SI units, its keys, the scenes of a sweep, what can be varied.

Not here: reading or writing them (read, data), friction laws (laws), geometry of outlines (shapes),
any solve.
"""
