"""Friction laws: one record of one law or of many, its shapes, its derivatives, and how it varies
along Γ_C.

Not here: studies and their keys (scene), reading them (read), problems with a law in them
(contact).
"""
