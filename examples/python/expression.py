"""Pictures of a run on a face: at rest and as it ended, from the front and at three quarters, and its muscles coloured by
stretch, from 0.7 (red) by 1 (white) to 1.3 (blue).

    python examples/python/expression.py runs/smile-0001 smile.png           # --half for half a face, which is mirrored

Needs vtk (pip install vtk).
"""

import argparse
import pathlib

import vtk

from face import FOCUS, SKIN, VIEWS, actor, eyes, mouth, save


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


def muscles(path, half):
    """The points of the muscles as balls."""
    reader = vtk.vtkXMLUnstructuredGridReader()
    reader.SetFileName(str(path))
    reader.Update()
    grid = reader.GetOutput()
    grid.GetPointData().SetActiveScalars("stretch")
    ball = vtk.vtkSphereSource()
    ball.SetRadius(0.9)
    colours = vtk.vtkColorTransferFunction()
    for stretch, colour in ((0.7, (0.70, 0.02, 0.15)), (1.0, (0.87, 0.87, 0.87)), (1.3, (0.23, 0.30, 0.75))):
        colours.AddRGBPoint(stretch, *colour)
    for side in (1, -1) if half else (1,):
        turn = vtk.vtkTransform()
        turn.Scale(side, 1, 1)
        turned = vtk.vtkTransformFilter()
        turned.SetInputData(grid)
        turned.SetTransform(turn)
        balls = vtk.vtkGlyph3D()
        balls.SetInputConnection(turned.GetOutputPort())
        balls.SetSourceConnection(ball.GetOutputPort())
        balls.ScalingOff()
        balls.SetColorModeToColorByScalar()
        mapper = vtk.vtkPolyDataMapper()
        mapper.SetInputConnection(balls.GetOutputPort())
        mapper.SetLookupTable(colours)
        one = vtk.vtkActor()
        one.SetMapper(mapper)
        yield one


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
    panes = [(view, at_rest, False) for at_rest in (True, False) for view in ("front", "three quarters")]
    panes.append(("front", False, True))
    window.SetSize(400 * len(panes), 440)
    for k, (view, at_rest, inside) in enumerate(panes):
        renderer = vtk.vtkRenderer()
        renderer.SetBackground(1, 1, 1)
        renderer.SetViewport(k / len(panes), 0, (k + 1) / len(panes), 1)
        renderer.AddActor(actor(skin(shape, at_rest, arguments.half), SKIN, 0.25 if inside else 1.0))
        points = arguments.run / f"view/muscles_{arguments.frame:04}.vtu"
        for part in muscles(points, arguments.half) if inside else (*eyes(), mouth()):
            renderer.AddActor(part)
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
