"""The verge clock as two bodies in inelastic impact; face `clock` (kernel impact).

Methods: `_closed_cycle` (formula), `_followed` (contact by contact).
"""
