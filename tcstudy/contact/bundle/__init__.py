"""The bundle-Newton method for any locally Lipschitz function, and the contact problem as one of these.

Only contact.py knows friction. Not here: anything that the separable structure of Ψ makes cheaper (contact/descent.py).
"""
