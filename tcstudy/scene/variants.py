"""A sweep of the body or its meshes: one study for each geometry, with the points that share its mesh and factor.

What is swept of body and mesh is the outer loop of a run: every `Variant` is a study of its own, in which these numbers
are fixed and the rest of the sweep is as it was. The whole study has the axes of all, and its scenes from the variants.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, overload

import numpy as np
from numpy.typing import NDArray

from tcstudy.scene.records import Scene

if TYPE_CHECKING:
    from tcstudy.scene.study import Study

GEOMETRIC = ("body", "mesh")
"""Sections that make a geometry."""


@dataclass(frozen=True, eq=False)
class Variant:
    """One geometry of a sweep.

    words:  its swept numbers, for messages
    index:  place of each among the values of its axis
    places: (P,) its points in the sweep of the whole study, counted in C order
    study:  its study; None where the geometry is refused
    reason: why it is refused, in words
    """

    words: str
    index: tuple[int, ...]
    places: NDArray[np.intp]
    study: Study | None
    reason: str = ""


class VariantScenes(Sequence[Scene]):
    """The scenes of all variants in the order of the whole sweep; a refused one has those of the first that is not."""

    def __init__(self, variants: Sequence[Variant]) -> None:
        self._known = next(one.study for one in variants if one.study is not None)
        self._variants = tuple(variants)
        total = sum(len(one.places) for one in variants)
        self._of, self._at = np.empty(total, dtype=np.intp), np.empty(total, dtype=np.intp)
        for number, one in enumerate(variants):
            self._of[one.places], self._at[one.places] = number, np.arange(len(one.places))

    def __len__(self) -> int:
        return len(self._of)

    @overload
    def __getitem__(self, index: int) -> Scene: ...
    @overload
    def __getitem__(self, index: slice) -> tuple[Scene, ...]: ...
    def __getitem__(self, index: int | slice) -> Scene | tuple[Scene, ...]:
        if isinstance(index, slice):
            return tuple(self[i] for i in range(*index.indices(len(self))))
        study = self._variants[self._of[index]].study or self._known
        return study.scenes[int(self._at[index])]

    def __iter__(self) -> Iterator[Scene]:
        return (self[i] for i in range(len(self)))

    def __repr__(self) -> str:
        return f"<{len(self)} scenes of {len(self._variants)} geometries>"
