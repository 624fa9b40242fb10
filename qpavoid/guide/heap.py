"""Binary heap in the rows of a table: the open list of a search."""

from typing import NamedTuple

from qpavoid.compiled import compiled, compiled_once
from qpavoid.types import Array


class Item(NamedTuple):
    """An entry, ordered by its fields.

    Attributes:
        cost: First key.
        i: Of a cell, or the number of a node.
        j: Of a cell.
    """

    cost: float
    i: int
    j: int


HEAP_WIDTH = 3


@compiled
def item_at(heap: Array, row: int) -> Item:
    """Return the entry of a row."""
    return Item(heap[row, 0], int(heap[row, 1]), int(heap[row, 2]))


@compiled
def set_item(heap: Array, row: int, item: Item) -> None:
    """Write a row."""
    heap[row, 0], heap[row, 1], heap[row, 2] = item.cost, item.i, item.j


@compiled
def is_before(one: Item, other: Item) -> bool:
    """Return whether an entry is before another one, in the order of tuples."""
    if one.cost != other.cost:
        return one.cost < other.cost
    if one.i != other.i:
        return one.i < other.i
    return one.j < other.j


@compiled_once
def push(heap: Array, count: int, item: Item) -> int:
    """Add an entry to ``count`` entries; return their new number."""
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
    """Remove the first of ``count`` entries; return their new number."""
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
