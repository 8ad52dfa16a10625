"""Results for other programs: fields for ParaView, tables for spreadsheets.

Not here: the result file itself (data).
"""
