"""Sobol indices of drawn points: which parameter the variance of a result comes from.

`first_order` serves points of any design, `saltelli` those drawn for totals, too. Both return a
value, the ends of its confidence interval, and the reason where an interval would not hold.
"""
