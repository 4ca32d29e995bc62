"""Reads the folder `view` of a run with VTK itself: `python check_vtu.py RUN [--png FILE]` (needs `pip install vtk`).

Every Bezier cell is evaluated by VTK at the 27 points of the linear set, which the solver wrote from its own basis:
position, displacement, reference and pressure must agree, and the map must not fold. The lists must name files that exist
and carry the time of the list. Exit 0 if all is well.
"""

import argparse
import pathlib
import xml.etree.ElementTree as ElementTree

import numpy as np
import vtk
from vtk.util.numpy_support import vtk_to_numpy

RELATIVE = 1e-12


def read(path):
    """The grid of a file, and its time."""
    reader = vtk.vtkXMLUnstructuredGridReader()
    reader.SetFileName(str(path))
    reader.Update()
    assert reader.GetErrorCode() == 0, f"{path}: VTK error {reader.GetErrorCode()}"
    grid = reader.GetOutput()
    return grid, grid.GetFieldData().GetArray("TimeValue").GetValue(0)


def frames(collection):
    """(time, path) of every file that a list names."""
    if not collection.exists():
        return []
    sets = ElementTree.parse(collection).getroot().iter("DataSet")
    return [(float(s.get("timestep")), collection.parent / s.get("file")) for s in sets]


def field(grid, name):
    return vtk_to_numpy(grid.GetPointData().GetArray(name))


def evaluate(cell, xi):
    """Position of a cell at xi by VTK, and the weights of its points."""
    x, weights = [0.0] * 3, [0.0] * cell.GetNumberOfPoints()
    cell.EvaluateLocation(vtk.reference(0), list(xi), x, weights)
    return np.array(x), np.array(weights)


def jacobian(cell, xi, h=1e-5):
    columns = []
    for d in range(3):
        step = np.eye(3)[d] * h
        columns.append((evaluate(cell, xi + step)[0] - evaluate(cell, xi - step)[0]) / (2 * h))
    return np.linalg.det(np.array(columns).T)


def check_shape(exact, linear):
    """Greatest difference between the exact cells and the linear set, relative to the size of each field.

    A displacement is the difference of two positions, and rounded as they are: it is measured by the box, however small it is.
    """
    points = np.array([[i, j, k] for k in (0, 0.5, 1) for j in (0, 0.5, 1) for i in (0, 0.5, 1)])
    names = ["displacement_mm", "reference_mm", "pressure_kpa"]
    size = {name: np.abs(field(linear, name)).max() + 1e-300 for name in names}
    box = linear.GetLength()
    size["displacement_mm"] = box
    worst, smallest = 0.0, np.inf
    random = np.random.default_rng(0)
    for element in range(exact.GetNumberOfCells()):
        cell = exact.GetCell(element)
        assert cell.GetClassName() == "vtkBezierHexahedron", cell.GetClassName()
        ids = [cell.GetPointId(i) for i in range(cell.GetNumberOfPoints())]
        for k, xi in enumerate(points):
            x, weights = evaluate(cell, xi)
            at = 27 * element + k
            worst = max(worst, np.abs(x - linear.GetPoint(at)).max() / box)
            for name in names:
                difference = weights @ field(exact, name)[ids] - field(linear, name)[at]
                worst = max(worst, np.abs(difference).max() / size[name])
        smallest = min(smallest, *(jacobian(cell, xi) for xi in random.uniform(0.01, 0.99, (8, 3))))
    return worst, smallest


def check_points(path):
    """Muscle points: fibres of length one, stretches positive."""
    grid, _ = read(path)
    fibre, stretch = field(grid, "fibre"), field(grid, "stretch")
    assert np.abs(np.linalg.norm(fibre, axis=1) - 1).max() < RELATIVE and stretch.min() > 0, path
    return grid.GetNumberOfPoints()


def render(run, png):
    """The last frame: the exact surface coloured by displacement, muscle points by stretch."""
    _, path = frames(run / "view/result.pvd")[-1]
    grid, _ = read(path)
    surface = vtk.vtkDataSetSurfaceFilter()
    surface.SetInputData(grid)
    surface.SetNonlinearSubdivisionLevel(4)
    surface.Update()
    surface.GetOutput().GetPointData().SetActiveScalars("displacement_mm")
    mapper = vtk.vtkPolyDataMapper()
    mapper.SetInputConnection(surface.GetOutputPort())
    mapper.SetScalarModeToUsePointFieldData()
    mapper.SelectColorArray("displacement_mm")
    table = vtk.vtkLookupTable()
    table.SetHueRange(0.667, 0.0)
    table.SetVectorModeToMagnitude()
    mapper.SetLookupTable(table)
    length = np.linalg.norm(field(grid, "displacement_mm"), axis=1)
    mapper.SetScalarRange(0.0, length.max())
    actor = vtk.vtkActor()
    actor.SetMapper(mapper)
    actor.GetProperty().SetOpacity(0.55)
    renderer = vtk.vtkRenderer()
    renderer.SetBackground(1, 1, 1)
    renderer.AddActor(actor)
    bar = vtk.vtkScalarBarActor()
    bar.SetLookupTable(table)
    bar.SetTitle("displacement mm")
    bar.GetTitleTextProperty().SetColor(0, 0, 0)
    bar.GetLabelTextProperty().SetColor(0, 0, 0)
    renderer.AddViewProp(bar)
    for _, path in frames(run / "view/muscles.pvd")[-1:]:
        points, _ = read(path)
        points.GetPointData().SetActiveScalars("stretch")
        points.GetPointData().SetActiveVectors("fibre")
        source = vtk.vtkCylinderSource()
        source.SetRadius(0.08)
        turned = vtk.vtkTransformFilter()
        turn = vtk.vtkTransform()
        turn.RotateZ(90)
        turned.SetTransform(turn)
        turned.SetInputConnection(source.GetOutputPort())
        glyph = vtk.vtkGlyph3D()
        glyph.SetInputData(points)
        glyph.SetSourceConnection(turned.GetOutputPort())
        glyph.SetVectorModeToUseVector()
        glyph.SetScaleModeToDataScalingOff()
        glyph.SetScaleFactor(1.2)
        mapper = vtk.vtkPolyDataMapper()
        mapper.SetInputConnection(glyph.GetOutputPort())
        mapper.ScalarVisibilityOff()
        fibres = vtk.vtkActor()
        fibres.SetMapper(mapper)
        fibres.GetProperty().SetColor(0.5, 0.0, 0.0)
        renderer.AddActor(fibres)
    window = vtk.vtkRenderWindow()
    window.SetOffScreenRendering(1)
    window.SetSize(1000, 700)
    window.AddRenderer(renderer)
    camera = renderer.GetActiveCamera()
    camera.SetPosition(-1, -2, 1.2)
    camera.SetViewUp(0, 0, 1)
    renderer.ResetCamera()
    camera.Zoom(1.2)
    window.Render()
    image = vtk.vtkWindowToImageFilter()
    image.SetInput(window)
    writer = vtk.vtkPNGWriter()
    writer.SetFileName(png)
    writer.SetInputConnection(image.GetOutputPort())
    writer.Write()


def main():
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("run", type=pathlib.Path)
    parser.add_argument("--png", help="draw the last frame")
    arguments = parser.parse_args()
    view = arguments.run / "view"
    exact, linear = frames(view / "result.pvd"), frames(view / "linear/result.pvd")
    assert exact and len(exact) == len(linear), "no frames, or not the same in both sets"
    for (time, path), (_, beside) in zip(exact, linear):
        grid, own_time = read(path)
        assert own_time == time, f"{path}: time {own_time}, in the list {time}"
        sampled, _ = read(beside)
        worst, smallest = check_shape(grid, sampled)
        cells = grid.GetNumberOfCells()
        print(f"{path.name}: {cells} cells, difference {worst:.1e}, smallest det(dx/dxi) {smallest:.4g} mm3")
        assert worst < RELATIVE and smallest > 0
    for _, path in frames(view / "muscles.pvd"):
        print(f"{path.name}: {check_points(path)} points")
    for _, path in frames(view / "markers.pvd"):
        grid, _ = read(path)
        print(f"{path.name}: {grid.GetNumberOfPoints()} points")
    if arguments.png:
        render(arguments.run, arguments.png)
    print("VTK", vtk.vtkVersion.GetVTKVersion(), "agrees")


if __name__ == "__main__":
    main()
