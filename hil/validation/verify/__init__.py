"""Takes the plant and gives numbers and figures that hold it against what is not ours.

Balances, closed forms, independent models.
"""
