"""Reads the EX files of a run with Zinc: `python check_exf.py RUN` (needs `pip install cmlibs.zinc vtk numpy`).

Zinc evaluates the fields `coordinates` and `deformed` of every element at random points. They must agree with the Bezier
cells that the same run wrote for ParaView, evaluated here with Bernstein's cubics; the quadrature points of the muscles
with those in the VTU file. Of a run that fitted fibres, the axes that Zinc makes of the angles in `fibres.exf` must be those
of `view/fibres.vtu`. `python check_exf.py A.exf B.exf` compares the first field of coordinates of two EX files of the
same mesh instead, element by element in their order. Exit 0 if all is well.
"""

import argparse
import math
import pathlib

import numpy as np
from cmlibs.zinc.context import Context
from cmlibs.zinc.field import Field

RELATIVE = 1e-12
RNG = np.random.default_rng(1)


def read(path):
    """The root region of a file."""
    context = Context(str(path))
    region = context.getDefaultRegion()
    result = region.readFile(str(path))
    logger = context.getLogger()
    messages = [logger.getMessageTextAtIndex(i) for i in range(1, logger.getNumberOfMessages() + 1)]
    assert result == 1 and not messages, f"{path}: Zinc says {messages}"
    return context, region


def elements(region):
    """Three-dimensional elements in the order of their numbers."""
    found, iterator = [], region.getFieldmodule().findMeshByDimension(3).createElementiterator()
    element = iterator.next()
    while element.isValid():
        found.append(element)
        element = iterator.next()
    return found


def evaluate(module, field, element, xi):
    cache = module.createFieldcache()
    cache.setMeshLocation(element, list(xi))
    result, values = field.evaluateReal(cache, 3)
    assert result == 1
    return np.array(values)


def bernstein(x):
    return np.array([(1 - x) ** 3, 3 * x * (1 - x) ** 2, 3 * x * x * (1 - x), x**3])


def vtk_order():
    """(i, j, k) of each of the 64 points of a cubic Bezier hexahedron as VTK orders them."""
    corners = [(0, 0, 0), (3, 0, 0), (3, 3, 0), (0, 3, 0)]
    order = [(i, j, k) for k in (0, 3) for i, j, _ in corners]
    for k in (0, 3):
        order += [(i, 0, k) for i in (1, 2)] + [(3, j, k) for j in (1, 2)]
        order += [(i, 3, k) for i in (1, 2)] + [(0, j, k) for j in (1, 2)]
    order += [(i, j, k) for i, j in ((0, 0), (3, 0), (3, 3), (0, 3)) for k in (1, 2)]
    order += [(i, j, k) for i in (0, 3) for k in (1, 2) for j in (1, 2)]
    order += [(i, j, k) for j in (0, 3) for k in (1, 2) for i in (1, 2)]
    order += [(i, j, k) for k in (0, 3) for j in (1, 2) for i in (1, 2)]
    order += [(i, j, k) for k in (1, 2) for j in (1, 2) for i in (1, 2)]
    return order


def vtu(path):
    """Points and point arrays of a VTU file."""
    import vtk
    from vtk.util.numpy_support import vtk_to_numpy

    reader = vtk.vtkXMLUnstructuredGridReader()
    reader.SetFileName(str(path))
    reader.Update()
    grid = reader.GetOutput()
    data = grid.GetPointData()
    arrays = {data.GetArrayName(i): vtk_to_numpy(data.GetArray(i)) for i in range(data.GetNumberOfArrays())}
    return vtk_to_numpy(grid.GetPoints().GetData()), arrays


def check_host(path, region):
    """The largest difference between Zinc's fields and the Bezier cells, over the size of the body."""
    points, arrays = vtu(path.with_suffix(".vtu"))
    module = region.getFieldmodule()
    order, worst = vtk_order(), 0.0
    for name, control in (("coordinates", arrays["reference_mm"]), ("deformed", points)):
        field = module.findFieldByName(name)
        for cell, element in enumerate(elements(region)):
            for xi in RNG.random((3, 3)):
                b = [bernstein(x) for x in xi]
                weights = np.array([b[0][i] * b[1][j] * b[2][k] for i, j, k in order])
                expected = weights @ control[64 * cell : 64 * cell + 64]
                worst = max(worst, np.abs(evaluate(module, field, element, xi) - expected).max())
    assert len(elements(region)) * 64 == len(points), "as many elements as cells"
    return worst / np.abs(points).max()


def check_muscles(path, region):
    """The largest difference between the data points and the points of the VTU file."""
    file = path.with_name(path.name.replace("result", "muscles")).with_suffix(".vtu")
    if not file.exists():
        return 0.0
    points, arrays = vtu(file)
    module = region.findSubregionAtPath("muscles").getFieldmodule()
    nodes = module.findNodesetByFieldDomainType(Field.DOMAIN_TYPE_DATAPOINTS)
    assert nodes.getSize() == len(points), "as many data points as points"
    cache, worst = module.createFieldcache(), 0.0
    columns = {"deformed": points, "fibre": arrays["fibre"], "stretch": arrays["stretch"]}
    for index in range(len(points)):
        cache.setNode(nodes.findNodeByIdentifier(index + 1))
        for name, values in columns.items():
            expected = np.atleast_1d(values[index])
            result, found = module.findFieldByName(name).evaluateReal(cache, len(expected))
            assert result == 1
            worst = max(worst, np.abs(np.atleast_1d(found) - expected).max())
    return worst / np.abs(points).max()


def check_fibres(run):
    """The largest difference between the places and the axes of Zinc and those of the VTU file."""
    _keep, region = read(run / "fibres.exf")
    points, arrays = vtu(run / "view" / "fibres.vtu")
    module = region.getFieldmodule()
    coordinates, angles = module.findFieldByName("coordinates"), module.findFieldByName("fibres")
    axes = module.createFieldFibreAxes(angles, coordinates)
    found = elements(region)
    # every element is drawn as parts x parts x parts hexahedra
    parts = round((len(points) / 8 / len(found)) ** (1 / 3))
    assert len(points) == 8 * parts**3 * len(found), "whole elements"
    corners = [(0, 0, 0), (1, 0, 0), (1, 1, 0), (0, 1, 0), (0, 0, 1), (1, 0, 1), (1, 1, 1), (0, 1, 1)]
    cells = [(i, j, k) for k in range(parts) for j in range(parts) for i in range(parts)]
    places = [tuple((c + e) / parts for c, e in zip(cell, corner)) for cell in cells for corner in corners]
    cache, size = module.createFieldcache(), np.abs(points).max()
    worst = [0.0, 0.0]
    for index in range(len(points)):
        cache.setMeshLocation(found[index // len(places)], list(places[index % len(places)]))
        at, along = coordinates.evaluateReal(cache, 3)[1], axes.evaluateReal(cache, 9)[1]
        expected = np.concatenate([arrays["fibre"][index], arrays["sheet"][index]])
        worst[0] = max(worst[0], np.abs(np.array(at) - points[index]).max() / size)
        worst[1] = max(worst[1], np.abs(np.array(along[:6]) - expected).max())
    return worst


def first_coordinates(region):
    iterator = region.getFieldmodule().createFielditerator()
    field = iterator.next()
    while field.isValid():
        if field.isTypeCoordinate() and field.getNumberOfComponents() == 3 and field.castFiniteElement().isValid():
            if field.getName() in ("coordinates", "deformed"):
                return field
        field = iterator.next()
    raise AssertionError("no field of coordinates")


def compare(a, b):
    """The largest difference between two files, over the size of the body."""
    (_keep_a, one), (_keep_b, other) = read(a), read(b)
    ours, theirs = elements(one), elements(other)
    assert len(ours) == len(theirs), "as many elements in both"
    worst, size = 0.0, 0.0
    modules = [region.getFieldmodule() for region in (one, other)]
    fields = [first_coordinates(region) for region in (one, other)]
    for pair in zip(ours, theirs):
        for xi in RNG.random((5, 3)):
            x, y = (evaluate(m, f, e, xi) for m, f, e in zip(modules, fields, pair))
            worst, size = max(worst, np.abs(x - y).max()), max(size, np.abs(x).max())
    return worst / size


def main():
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("paths", nargs="+", type=pathlib.Path)
    paths = parser.parse_args().paths
    if len(paths) == 2:
        errors = [("difference", compare(*paths))]
    elif (paths[0] / "fibres.exf").exists():
        errors = list(zip(["places", "axes of fibres and sheets"], check_fibres(paths[0])))
    else:
        files = sorted((paths[0] / "view").glob("result_*.exf"))
        assert files, "no EX file"
        errors = []
        for path in files:
            _keep, region = read(path)
            errors += [(f"{path.name} host", check_host(path, region)), (f"{path.name} muscles", check_muscles(path, region))]
    for name, error in errors:
        print(f"{name}: {error:.1e} of the size")
        assert math.isfinite(error) and error < RELATIVE


if __name__ == "__main__":
    main()
