"""A binary heap in rows of a table: what is expanded next, least cost first."""

from typing import NamedTuple

from qpavoid.compiled import compiled, compiled_once
from qpavoid.types import Array


class Item(NamedTuple):
    """What waits, in the order of its fields.

    Attributes:
        cost: By which it comes first.
        i: Of a cell, or the number of a node.
        j: Of a cell.
    """

    cost: float
    i: int
    j: int


HEAP_WIDTH = 3


@compiled
def item_at(heap: Array, row: int) -> Item:
    """Return what waits in a row."""
    return Item(heap[row, 0], int(heap[row, 1]), int(heap[row, 2]))


@compiled
def set_item(heap: Array, row: int, item: Item) -> None:
    """Write a row."""
    heap[row, 0], heap[row, 1], heap[row, 2] = item.cost, item.i, item.j


@compiled
def is_before(one: Item, other: Item) -> bool:
    """Return whether one item comes before another, as tuples do."""
    if one.cost != other.cost:
        return one.cost < other.cost
    if one.i != other.i:
        return one.i < other.i
    return one.j < other.j


@compiled_once
def push(heap: Array, count: int, item: Item) -> int:
    """Add an item to so many, and return how many there are then."""
    row = count
    while row > 0:
        above = (row - 1) // 2
        if not is_before(item, item_at(heap, above)):
            break
        set_item(heap, row, item_at(heap, above))
        row = above
    set_item(heap, row, item)
    return count + 1


@compiled_once
def drop_first(heap: Array, count: int) -> int:
    """Take the first of so many items out, and return how many are left."""
    last, row = item_at(heap, count - 1), 0
    while 2 * row + 1 < count - 1:
        below = 2 * row + 1
        if below + 1 < count - 1:
            if is_before(item_at(heap, below + 1), item_at(heap, below)):
                below += 1
        if not is_before(item_at(heap, below), last):
            break
        set_item(heap, row, item_at(heap, below))
        row = below
    set_item(heap, row, last)
    return count - 1
