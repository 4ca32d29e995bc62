# %% [markdown]
# A run of risorius read with pandas, pyvista and mcap: nothing here is specific to it but the names of files and columns.
#
#     risorius run && risorius export runs/face-0001 --to mcap
#     pip install pandas pyvista mcap matplotlib
#     python examples/python/notebook.py runs/face-0001 OUT
#
# The cells between `# %%` open as a notebook in VS Code, Spyder or with jupytext.

# %%
import base64
import json
import pathlib
import sys

import numpy as np
import pandas
import pyvista
from mcap.reader import make_reader

run = pathlib.Path(sys.argv[1])
out = pathlib.Path(sys.argv[2] if len(sys.argv) > 2 else ".")
out.mkdir(parents=True, exist_ok=True)

# %% [markdown]
# Tables. Units stand in the names of columns, an empty cell is a lost value. The same with types and in less space: `risorius export RUN
# --to parquet`, then `pandas.read_parquet(run / "export/tables/activations.parquet")`.

# %%
activations = pandas.read_csv(run / "tables/activations.csv").set_index("time_s")
controls = [c for c in activations.columns if c != "frame" and not c.endswith("_sd")]
strongest = pandas.DataFrame({"strongest": activations[controls].max(), "at_s": activations[controls].idxmax()})
print(strongest)

markers = pandas.read_csv(run / "tables/markers.csv")
residual = markers.pivot(index="time_s", columns="name", values="distance_mm")
print(f"rms {np.sqrt(np.nanmean(residual.values**2)):.3f} mm; {int(residual.isna().sum().sum())} samples lost")
print("worst markers, mm:", residual.max().nlargest(3).round(3).to_dict())

# %%
axes = activations[controls].plot(ylabel="activation")
for control, line in zip(controls, axes.get_lines()):
    sd = activations.get(f"{control}_sd")
    if sd is not None:
        low, high = (activations[control] - 1.96 * sd).clip(0), (activations[control] + 1.96 * sd).clip(upper=1)
        axes.fill_between(activations.index, low, high, alpha=0.3, color=line.get_color())
axes.figure.savefig(out / "activations.png", dpi=110)

# %% [markdown]
# Shapes. The linear set is for measuring; its points carry displacement, reference position, pressure and det F.

# %%
reader = pyvista.get_reader(str(run / "view/linear/result.pvd"))
largest = []
for time in reader.time_values:
    reader.set_active_time_value(time)
    body = reader.read()[0]
    largest.append(np.linalg.norm(body["displacement_mm"], axis=1).max())
most = int(np.argmax(largest))
print(f"moves most at {reader.time_values[most]:.3f} s: {largest[most]:.2f} mm")
reader.set_active_time_value(reader.time_values[most])
body = reader.read()[0]
print(f"volume {body.volume:.0f} mm3, det F {body['det_f'].min():.3f} to {body['det_f'].max():.3f}")

# %%
surface = body.extract_surface(algorithm="dataset_surface")
surface["displacement, mm"] = np.linalg.norm(surface["displacement_mm"], axis=1)
surface.save(out / "surface.vtp")
if "--picture" in sys.argv:
    plotter = pyvista.Plotter(off_screen=True)
    plotter.add_mesh(surface, scalars="displacement, mm", cmap="viridis")
    plotter.screenshot(out / "surface.png")

# %% [markdown]
# The MCAP file: JSON messages on the clock of the recording, in metres.

# %%
rows, clouds = [], []
with open(run / "export/result.mcap", "rb") as file:
    for schema, channel, message in make_reader(file).iter_messages(
        topics=["/risorius/activations", "/risorius/solver", "/risorius/skin_points"]
    ):
        value = json.loads(message.data)
        if channel.topic == "/risorius/activations":
            rows.append({"stamp": message.log_time, **{c["name"]: c["value"] for c in value["controls"]}})
        elif channel.topic == "/risorius/skin_points":
            clouds.append(np.frombuffer(base64.b64decode(value["data"]), dtype="<f4").reshape(-1, 4))
stamped = pandas.DataFrame(rows)
stamped.index = pandas.to_datetime(stamped.pop("stamp"))
print(stamped.describe().loc[["min", "max"]])
print(f"recorded from {stamped.index[0]} on; the skin has {len(clouds[0])} points")

# %% [markdown]
# Three ways to the same numbers.

# %%
assert np.array_equal(stamped[controls].values, activations[controls].values)
assert abs(max(cloud[:, 3].max() for cloud in clouds) / max(largest) - 1) < 0.02, "skin and body move alike"
