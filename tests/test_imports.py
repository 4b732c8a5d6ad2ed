"""No module imports one that imports it, in a function or for types only either: the order of layers is not enough."""

import grimp

PACKAGES = ("shared", "datagen", "trainer", "diagnosis")


def circles(graph):
    """Sets of modules each of which can be reached from the others (Tarjan 1972), if there are two or more."""
    order, low, stack, found = {}, {}, [], []

    def visit(one):
        order[one] = low[one] = len(order)
        stack.append(one)
        for other in sorted(graph.find_modules_directly_imported_by(one)):
            if other not in order:
                visit(other)
            if other in stack:
                low[one] = min(low[one], low[other])
        if low[one] == order[one]:
            k = stack.index(one)
            found.append(frozenset(stack[k:]))
            del stack[k:]

    for one in sorted(graph.modules):
        if one not in order:
            visit(one)
    return {one for one in found if len(one) > 1}


def test_no_imports_go_round():
    assert circles(grimp.build_graph(*PACKAGES, cache_dir=None)) == set()


def test_a_circle_is_found():
    graph = grimp.ImportGraph()
    for one in "abcd":
        graph.add_module(one)
    for importer, imported in ("ab", "bc", "ca", "cd"):
        graph.add_import(importer=importer, imported=imported)
    assert circles(graph) == {frozenset("abc")}
