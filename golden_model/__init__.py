"""The golden model: the executable specification of Lightloom, and a renderer in its own right, in NumPy.

Its floors, the top first; an import leads from a floor to a lower one (`tests/test_rooms.py` holds that):

10. `renderer`, `oracle`, `models`
9. `driver`
8. `frame`, `charts`, `stimuli`
7. `structures`, `pictures`
6. `scene`
5. `engine`, `machine`
4. `tracing`, `rays`
3. `tables`
2. `numerics`
1. `contract`, `host`

What hardware does lies below the scene: it works on tables.
A unit's name here is its name in `rtl` and in `verif`.
"""

if __name__ != "lightloom.golden_model":
    raise ImportError("golden_model is a room of lightloom: import lightloom.golden_model")
