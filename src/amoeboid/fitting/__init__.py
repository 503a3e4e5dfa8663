"""Parameters from measurements: least squares on polarized steady states.

A table of measured profiles and numbers (`measurements`), polarized states followed as parameters
change (`followed`), what they predict (`predictions`), the fit and what its data leave open.
"""
