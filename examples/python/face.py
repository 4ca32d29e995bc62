"""Pictures of the face: the folder that `cargo run --example face -- OUT` wrote, from the front, at three quarters and from the side.

    python examples/python/face.py OUT skin.png              # the skin
    python examples/python/face.py OUT muscles.png --muscles # muscles and their fibres under a translucent skin

Needs vtk (pip install vtk).
"""

import argparse
import csv
import math
import pathlib

import vtk

VIEWS = {"front": (0, 8, 640), "three quarters": (400, 40, 480), "side": (560, 8, 75)}
FOCUS = (0, 8, 75)
SKIN = (0.91, 0.73, 0.63)
# red to brown in turn, so that neighbours differ
COLOURS = [(0.72, 0.16, 0.14), (0.83, 0.35, 0.25), (0.60, 0.12, 0.22), (0.78, 0.45, 0.30), (0.66, 0.26, 0.36)]


def surface(path, weld):
    reader = vtk.vtkOBJReader()
    reader.SetFileName(str(path))
    # elements bring their own points: those that coincide become one, so that the surface is shaded as one
    clean = vtk.vtkCleanPolyData()
    clean.SetInputConnection(reader.GetOutputPort())
    clean.ToleranceIsAbsoluteOn()
    clean.SetAbsoluteTolerance(weld)
    normals = vtk.vtkPolyDataNormals()
    normals.SetInputConnection(clean.GetOutputPort())
    normals.SetFeatureAngle(50)
    normals.ConsistencyOff()
    return normals


def actor(source, colour, opacity=1.0):
    mapper = vtk.vtkPolyDataMapper()
    mapper.SetInputConnection(source.GetOutputPort())
    one = vtk.vtkActor()
    one.SetMapper(mapper)
    looks = one.GetProperty()
    looks.SetColor(*colour)
    looks.SetOpacity(opacity)
    looks.SetAmbient(0.15)
    looks.SetSpecular(0.15)
    looks.SetSpecularPower(20)
    return one


def eyes():
    """Two white balls behind the lids, which are no part of the model."""
    for side in (1, -1):
        for radius, z, colour in ((13.5, 80.8, (0.95, 0.95, 0.93)), (5.6, 89.2, (0.35, 0.28, 0.22))):
            ball = vtk.vtkSphereSource()
            ball.SetCenter(side * 31.5, 34.8, z)
            ball.SetRadius(radius)
            ball.SetThetaResolution(48)
            ball.SetPhiResolution(48)
            yield actor(ball, colour)


def mouth():
    """The dark behind the lips, which is no part of the model."""
    ball = vtk.vtkSphereSource()
    ball.SetRadius(1.0)
    ball.SetThetaResolution(48)
    ball.SetPhiResolution(48)
    shape = vtk.vtkTransform()
    shape.Translate(0, -46, 78)
    shape.Scale(28, 26, 18)
    shaped = vtk.vtkTransformPolyDataFilter()
    shaped.SetInputConnection(ball.GetOutputPort())
    shaped.SetTransform(shape)
    return actor(shaped, (0.24, 0.08, 0.08))


def fibres(path):
    lines = vtk.vtkAppendPolyData()
    for row in csv.DictReader(open(path)):
        x = [float(row[k]) for k in ("x_mm", "y_mm", "z_mm")]
        d = [float(row[k]) for k in ("dx", "dy", "dz")]
        line = vtk.vtkLineSource()
        line.SetPoint1(*(a - 2.0 * b for a, b in zip(x, d)))
        line.SetPoint2(*(a + 2.0 * b for a, b in zip(x, d)))
        lines.AddInputConnection(line.GetOutputPort())
    tube = vtk.vtkTubeFilter()
    tube.SetInputConnection(lines.GetOutputPort())
    tube.SetRadius(0.25)
    return actor(tube, (1.0, 0.93, 0.85))


def save(window, path):
    window.Render()
    image = vtk.vtkWindowToImageFilter()
    image.SetInput(window)
    image.ReadFrontBufferOff()
    writer = vtk.vtkPNGWriter()
    writer.SetFileName(str(path))
    writer.SetInputConnection(image.GetOutputPort())
    writer.Write()


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("folder", type=pathlib.Path)
    parser.add_argument("picture", type=pathlib.Path)
    parser.add_argument("--muscles", action="store_true")
    parser.add_argument("--deep", action="store_true", help="the deep surface in place of the skin")
    parser.add_argument("--size", type=int, default=520, help="pixels across one view")
    args = parser.parse_args()

    skin = surface(args.folder / ("deep.obj" if args.deep else "skin.obj"), 1e-4)
    actors = [actor(skin, SKIN, 0.25 if args.muscles else 1.0)] + list(eyes())
    if args.muscles:
        names = sorted({p.name.rsplit(".", 2)[0] for p in args.folder.glob("*.[LR].obj")})
        for index, name in enumerate(names):
            for side in "LR":
                actors.append(actor(surface(args.folder / f"{name}.{side}.obj", 1e-4), COLOURS[index % len(COLOURS)]))
        actors.append(fibres(args.folder / "fibres.csv"))

    window = vtk.vtkRenderWindow()
    window.SetOffScreenRendering(1)
    window.SetMultiSamples(8)
    window.SetSize(args.size * len(VIEWS), int(1.12 * args.size))
    for index, position in enumerate(VIEWS.values()):
        view = vtk.vtkRenderer()
        view.SetBackground(1, 1, 1)
        view.SetViewport(index / len(VIEWS), 0, (index + 1) / len(VIEWS), 1)
        if args.muscles:
            view.SetUseDepthPeeling(1)
            view.SetMaximumNumberOfPeels(20)
            window.SetAlphaBitPlanes(1)
            window.SetMultiSamples(0)
        for one in actors:
            view.AddActor(one)
        camera = view.GetActiveCamera()
        camera.SetFocalPoint(*FOCUS)
        camera.SetPosition(*position)
        camera.SetViewAngle(2 * math.degrees(math.atan(118 / 640)))
        view.AutomaticLightCreationOff()
        for place, strength in (((250, 300, 500), 0.8), ((-400, 100, 300), 0.35), ((0, -300, 300), 0.15)):
            light = vtk.vtkLight()
            light.SetPosition(*place)
            light.SetFocalPoint(0, 0, 60)
            light.SetIntensity(strength)
            view.AddLight(light)
        view.ResetCameraClippingRange()
        window.AddRenderer(view)
    save(window, args.picture)


if __name__ == "__main__":
    main()
