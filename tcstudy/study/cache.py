"""A small cache by value that forgets the least recently used entries beyond a memory budget."""

from __future__ import annotations

from collections import OrderedDict
from collections.abc import Callable, Hashable
from typing import Generic, TypeVar

T = TypeVar("T")


class Recent(Generic[T]):
    """Values by key, made on demand; the oldest go when the total size passes `budget` bytes.

    Values that are still referenced elsewhere stay alive there: forgetting costs time later, never correctness.
    """

    def __init__(self, budget: float, size: Callable[[T], int]) -> None:
        self._entries: OrderedDict[Hashable, T] = OrderedDict()
        self._budget, self._size, self._total = budget, size, 0

    def get(self, key: Hashable, make: Callable[[], T]) -> T:
        """The value of `key`, made by `make` if it is not there."""
        if key in self._entries:
            self._entries.move_to_end(key)
            return self._entries[key]
        value = make()
        self._entries[key] = value
        self._total += self._size(value)
        while self._total > self._budget and len(self._entries) > 1:
            self._total -= self._size(self._entries.popitem(last=False)[1])
        return value
