"""The golden model: the executable specification of Lightloom, and a renderer in its own right, in NumPy.

Its floors, the top first; an import leads from a floor to a lower one (`tests/test_rooms.py` holds that):

5. `renderer`, `oracle`
4. `maintenance`, `frame`, `charts`, `models`, `stimuli`
3. `tracing`, `rays`, `pictures`
2. `scene`, `machine`
1. `contract`, `numerics`, `host`

A unit's name here is its name in `rtl` and in `verif`.
"""
