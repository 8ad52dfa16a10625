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
        found = self.find(key)
        if found is not None:
            return found
        value = make()
        self.put(key, value)
        return value

    def find(self, key: Hashable) -> T | None:
        """The value of `key` if it is there."""
        if key not in self._entries:
            return None
        self._entries.move_to_end(key)
        return self._entries[key]

    def put(self, key: Hashable, value: T) -> None:
        """Keep a value under a key that is not there; the oldest entries make room for it."""
        self._entries[key] = value
        self._total += self._size(value)
        while self._total > self._budget and len(self._entries) > 1:
            self._total -= self._size(self._entries.popitem(last=False)[1])

    def clear(self) -> None:
        """Forget everything, for values so large that two must not stand side by side."""
        self._entries.clear()
        self._total = 0
