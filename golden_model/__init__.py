"""The golden model: the executable specification of Lightloom, and a renderer in its own right.

Everything here is NumPy. A unit's name here is its name in `rtl` and in `verif`.
"""
