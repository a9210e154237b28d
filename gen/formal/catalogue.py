"""All properties."""

from gen.formal import arbiter, box_test, cache, control, counting, cuts, numbers, queues, special_cases, stream_units
from gen.formal.properties import Property

PROPERTIES: dict[str, Property] = {
    one.key: one
    for room in (stream_units, queues, arbiter, counting, cache, control, special_cases, cuts, numbers, box_test)
    for one in room.properties()
}
"""By `unit/property`."""
