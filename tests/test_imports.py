"""No module imports one that imports it, in a function or for types only either: the order of layers is not enough."""

from graphlib import CycleError, TopologicalSorter

import grimp
import pytest


def in_order(graph):
    """Raise CycleError if modules import each other in a circle."""
    TopologicalSorter({one: graph.find_modules_directly_imported_by(one) for one in graph.modules}).prepare()


def test_no_imports_go_round():
    graph = grimp.build_graph("shared", "datagen", "trainer", "diagnosis", cache_dir=None)
    in_order(graph)
    graph.add_import(importer="shared.errors", imported="trainer.cli")
    with pytest.raises(CycleError):
        in_order(graph)
