"""The benchmarks that run on demand still fit the package: their modules load and their studies are read."""

from __future__ import annotations

from importlib import import_module
from pathlib import Path

import pytest

import tcstudy
from tests.benchmarks import cores, gallery, online

MODULES = [
    path.stem for path in sorted(Path(__file__).parent.glob("*.py")) if path.stem not in ("__init__", "__main__")
]


@pytest.mark.parametrize("name", MODULES)
def test_every_module_loads(name: str) -> None:
    import_module(f"tests.benchmarks.{name}")


def test_their_changes_of_the_quickstart_are_read() -> None:
    assert len(tcstudy.load(cores.QUICK, cores.changes(cores.FINE, 2, 3, 4)).scenes) == 24
    assert [len(study.scenes) for study in online.studies()] == [1000, 1000, 1000]


def test_the_gallery_is_what_it_makes() -> None:
    """A picture that nothing draws any more would show what the program no longer does."""
    stored = {path.stem.removeprefix("gallery-") for path in (gallery.ROOT / "results").glob("gallery-*.png")}
    assert stored == set(gallery.DRAWN)
