"""Draws frames of runs side by side to a PNG: the deformed skin, muscles coloured by stretch, measured markers and residuals.

    pip install vtk
    python3 examples/python/picture.py runs/beam-0001:0 runs/beam-0001:14 runs/beam-0001:26 problems/beam/beam.png

A frame may have a caption: runs/figure_1-0001:0="36 degrees".
"""
import os
import sys
import vtk


def read(path):
    reader = vtk.vtkXMLUnstructuredGridReader()
    reader.SetFileName(path)
    reader.Update()
    return reader.GetOutput()


def actor(data, opacity=1.0, colour=None, array=None, span=None, size=None):
    mapper = vtk.vtkDataSetMapper()
    mapper.SetInputData(data)
    if array:
        table = vtk.vtkLookupTable()
        table.SetHueRange(0.0, 0.62)
        table.SetTableRange(*span)
        table.Build()
        mapper.SetLookupTable(table)
        mapper.SetScalarModeToUsePointFieldData()
        mapper.SelectColorArray(array)
        mapper.SetScalarRange(*span)
    else:
        mapper.ScalarVisibilityOff()
    result = vtk.vtkActor()
    result.SetMapper(mapper)
    p = result.GetProperty()
    p.SetOpacity(opacity)
    if colour:
        p.SetColor(*colour)
    if size:
        p.SetPointSize(size)
        p.SetRenderPointsAsSpheres(True)
    return result


def frame_of(argument):
    """run:frame or run:frame=caption"""
    run, _, rest = argument.partition(":")
    frame, _, caption = rest.partition("=")
    return run, int(frame), caption or f"frame {frame}"


def main(frames, png):
    window = vtk.vtkRenderWindow()
    window.SetOffScreenRendering(1)
    window.SetSize(440 * len(frames), 330)
    window.SetMultiSamples(8)
    for k, (run, frame, caption) in enumerate(frames):
        renderer = vtk.vtkRenderer()
        renderer.SetBackground(1, 1, 1)
        renderer.SetViewport(k / len(frames), 0, (k + 1) / len(frames), 1)
        skin = vtk.vtkDataSetSurfaceFilter()
        merge = vtk.vtkCleanUnstructuredGrid()
        merge.SetInputData(read(f"{run}/view/linear/result_{frame:04}.vtu"))
        merge.Update()
        skin.SetInputData(merge.GetOutput())
        skin.Update()
        renderer.AddActor(actor(skin.GetOutput(), 0.35, (0.93, 0.75, 0.66)))
        edges = vtk.vtkExtractEdges()
        edges.SetInputData(skin.GetOutput())
        edges.Update()
        renderer.AddActor(actor(edges.GetOutput(), 0.25, (0.45, 0.3, 0.25)))
        muscles = read(f"{run}/view/muscles_{frame:04}.vtu")
        renderer.AddActor(actor(muscles, array="stretch", span=(0.6, 1.05), size=7))
        markers = f"{run}/view/markers_{frame:04}.vtu"
        if os.path.exists(markers):
            renderer.AddActor(actor(read(markers), colour=(0.05, 0.05, 0.05), size=9))
        camera = renderer.GetActiveCamera()
        camera.SetPosition(30, -150, 60)
        camera.SetFocalPoint(28, 10, 14)
        camera.SetViewUp(0, 0, 1)
        camera.SetViewAngle(23)
        renderer.ResetCameraClippingRange()
        text = vtk.vtkTextActor()
        text.SetInput(caption)
        text.GetTextProperty().SetColor(0, 0, 0)
        text.GetTextProperty().SetFontSize(20)
        text.SetPosition(12, 10)
        renderer.AddViewProp(text)
        window.AddRenderer(renderer)
    window.Render()
    image = vtk.vtkWindowToImageFilter()
    image.SetInput(window)
    image.ReadFrontBufferOff()
    image.Update()
    writer = vtk.vtkPNGWriter()
    writer.SetFileName(png)
    writer.SetInputConnection(image.GetOutputPort())
    writer.Write()


if __name__ == "__main__":
    main([frame_of(argument) for argument in sys.argv[1:-1]], sys.argv[-1])
