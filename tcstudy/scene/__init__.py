"""What a study is: frozen records in SI units, friction laws, the scenes of a sweep, what can be varied.

Not here: reading or writing them (read, data), geometry of outlines (shapes), anything that is solved.
"""
