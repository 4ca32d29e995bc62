"""Pictures of a run on a face: at rest and as it ended, from the front and from the side.

    python examples/python/expression.py runs/smile-0001 smile.png           # --half for half a face, which is mirrored

Needs vtk (pip install vtk).
"""

import argparse
import pathlib

import vtk

from face import FOCUS, SKIN, VIEWS, actor, eyes, save


def skin(path, at_rest, half):
    """The surface of the body, as one piece."""
    reader = vtk.vtkXMLUnstructuredGridReader()
    reader.SetFileName(str(path))
    reader.Update()
    grid = reader.GetOutput()
    if at_rest:
        points, moved = grid.GetPoints(), grid.GetPointData().GetArray("displacement_mm")
        for k in range(grid.GetNumberOfPoints()):
            points.SetPoint(k, [x - u for x, u in zip(points.GetPoint(k), moved.GetTuple(k))])
    whole = vtk.vtkAppendFilter()
    whole.AddInputData(grid)
    if half:
        turn = vtk.vtkTransform()
        turn.Scale(-1, 1, 1)
        mirrored = vtk.vtkTransformFilter()
        mirrored.SetInputData(grid)
        mirrored.SetTransform(turn)
        mirrored.Update()
        whole.AddInputData(mirrored.GetOutput())
    # elements bring their own points: those that coincide become one, so that only the outside is left
    merged = vtk.vtkCleanUnstructuredGrid()
    merged.SetInputConnection(whole.GetOutputPort())
    merged.ToleranceIsAbsoluteOn()
    merged.SetAbsoluteTolerance(1e-4)
    outside = vtk.vtkDataSetSurfaceFilter()
    outside.SetInputConnection(merged.GetOutputPort())
    normals = vtk.vtkPolyDataNormals()
    normals.SetInputConnection(outside.GetOutputPort())
    normals.SetFeatureAngle(60)
    normals.ConsistencyOn()
    normals.AutoOrientNormalsOn()
    return normals


def main():
    parser = argparse.ArgumentParser()
    parser.add_argument("run", type=pathlib.Path)
    parser.add_argument("png")
    parser.add_argument("--frame", type=int, default=0)
    parser.add_argument("--half", action="store_true")
    arguments = parser.parse_args()
    shape = arguments.run / f"view/linear/result_{arguments.frame:04}.vtu"
    window = vtk.vtkRenderWindow()
    window.SetOffScreenRendering(1)
    window.SetMultiSamples(8)
    panes = [(view, at_rest) for at_rest in (True, False) for view in ("front", "three quarters")]
    window.SetSize(400 * len(panes), 440)
    for k, (view, at_rest) in enumerate(panes):
        renderer = vtk.vtkRenderer()
        renderer.SetBackground(1, 1, 1)
        renderer.SetViewport(k / len(panes), 0, (k + 1) / len(panes), 1)
        renderer.AddActor(actor(skin(shape, at_rest, arguments.half), SKIN))
        for eye in eyes():
            renderer.AddActor(eye)
        camera = renderer.GetActiveCamera()
        camera.SetPosition(*VIEWS[view])
        camera.SetFocalPoint(*FOCUS)
        camera.SetViewUp(0, 1, 0)
        camera.SetViewAngle(24)
        renderer.ResetCameraClippingRange()
        window.AddRenderer(renderer)
    save(window, arguments.png)


if __name__ == "__main__":
    main()
