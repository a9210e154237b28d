"""The golden model: the executable specification of Lightloom, and a renderer in its own right, in NumPy.

Its floors, the top first; an import leads from a floor to a lower one (`tests/test_rooms.py` holds that):

7. `renderer`, `oracle`, `models`
6. `driver`
5. `engine`, `frame`, `charts`, `stimuli`
4. `tracing`, `rays`, `pictures`
3. `scene`, `machine`
2. `numerics`
1. `contract`, `host`

A unit's name here is its name in `rtl` and in `verif`.
"""

if __name__ != "lightloom.golden_model":
    raise ImportError("golden_model is a room of lightloom: import lightloom.golden_model")
