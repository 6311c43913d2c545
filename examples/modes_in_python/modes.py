# %% [markdown]
# # The modes in Python
#
# `rigid_motion.motion` fills in between keyed poses, measures what comes out, and finds the keys that a recording
# needs. It takes NumPy alone: no Blender is here. In a checkout, `pip install ".[notebook]"` brings what it runs with.

# %%
import matplotlib.pyplot as plt
import numpy as np

from rigid_motion.motion import MODES, Poses, decimate, interpolate, measure, reduce_keys, repair, rms
from rigid_motion.motion.quaternions import rotate
from rigid_motion_batch.palette import THEMES, colour_on
from rigid_motion_batch.places import ASSETS
from rigid_motion_batch.recordings.reading import read_trajectories

COLOURS = {mode: colour_on(THEMES["light"], mode) for mode in MODES}

# %% [markdown]
# ## From key to key
#
# Three keys of a bar: metres, and quaternions as w, x, y, z. From each to the next it turns by 120 degrees about z.

# %%
half_turns = np.radians([0, 60, 120])
quaternions = np.stack((np.cos(half_turns), 0 * half_turns, 0 * half_turns, np.sin(half_turns)), axis=1)
keys = Poses([[0, 0, 0], [1, 0, 0], [2, 0.4, 0]], quaternions)
key_times = [0, 1, 2]

times = np.linspace(0, 2, 200)
paths = {mode: interpolate(key_times, keys, times, mode) for mode in MODES}

# %% [markdown]
# Each mode from above. The line is the path of the bar's origin; the bar is drawn at even steps of time, and black at
# the keys. `dq_sclerp`, `pga_slerp` and, as nothing grows, `cga_slerp` are one motion: a screw. `pga_lerp` and
# `cga_lerp` run along the same path unevenly. The two splines have no corner at the key in the middle. `bezier` is what
# Blender makes of keys without any mode: each number by itself, at rest at the first key and at the last.


# %%
def draw_bars(axes, poses, colour, width):
    """A bar of 30 cm from the origin of each pose, along its y axis."""
    tips = poses.positions + rotate(poses.quaternions, np.broadcast_to([0, 0.3, 0], poses.positions.shape))
    ends = np.stack((poses.positions, tips))
    axes.plot(*ends[..., :2].T.swapaxes(1, 2), color=colour, linewidth=width, solid_capstyle="round")


figure, grid = plt.subplots(3, 3, figsize=(11, 5.4), sharex=True, sharey=True, layout="constrained")
for (mode, path), axes in zip(paths.items(), grid.flat, strict=True):
    axes.plot(*path.positions[:, :2].T, color=COLOURS[mode], linewidth=2)
    draw_bars(axes, path[::8], COLOURS[mode], 0.7)
    draw_bars(axes, keys, "black", 2)
    axes.set(title=mode, aspect="equal", xticks=[0, 1, 2], yticks=[-0.5, 0, 0.5], ylim=(-0.5, 0.7))
figure.supxlabel("x in metres")
figure.supylabel("y in metres")
plt.show()

# %% [markdown]
# ## Beside a recording
#
# A drill whose tip rests on a point while the hand swings it, 90 samples a second
# ([pivot.csv](../../assets/README.md)). Ten of them are kept as keys; what the modes make of these is measured against
# all samples. The shell error is the largest displacement of any point within 10 cm of the drill's origin.


# %%
def recording(clip):
    """The times and poses of a clip in assets/, repaired."""
    recorded = read_trajectories(str(ASSETS / f"{clip}.csv")).trajectories[0]
    times, poses, _ = repair(recorded.times, recorded.poses)
    return times, poses


times, poses = recording("pivot")
kept = decimate(times, rate=10)

errors = {}
for mode in MODES:
    shown = interpolate(times[kept], poses[kept], times, mode)
    errors[mode] = measure(times, shown, poses, radius=0.1)

print(f"{len(times)} samples, {len(kept)} keys; RMS of the errors")
print(f"{'mode':20} {'shell':>6} {'position':>9} {'rotation':>9} {'velocity':>9}")
print(f"{'':20} {'mm':>6} {'mm':>9} {'degrees':>9} {'mm/s':>9}")
for mode, of_mode in errors.items():
    shell, position, velocity = (1000 * rms(part) for part in (of_mode.shell, of_mode.position, of_mode.velocity))
    print(f"{mode:20} {shell:6.2f} {position:9.2f} {np.degrees(rms(of_mode.rotation)):9.2f} {velocity:9.0f}")

# %% [markdown]
# The error is zero at the keys, and largest half-way.

# %%
figure, axes = plt.subplots(figsize=(11, 3.2), layout="constrained")
for mode in ("bezier", "lerp_slerp", "dq_sclerp", "motor_spline"):
    axes.plot(times, 1000 * errors[mode].shell, color=COLOURS[mode], linewidth=1.2, label=MODES[mode].label)
axes.set(xlabel="seconds", ylabel="shell error in mm", xlim=(times[0], times[-1]), ylim=(0, None))
axes.legend(ncols=4, loc="lower center", bbox_to_anchor=(0.5, 1.0), frameon=False)
plt.show()

# %% [markdown]
# ## As few keys as do
#
# The other way round: the keys that each mode, and Blender's own curves, need so that no point of the shell is ever off
# by more than 5 mm. A screw is not better for everything: what flies, as in `throw`, has its centre on a parabola and
# turns about it, which suits Blender's curves best.

# %%
compared = ["bezier", "lerp_slerp", "dq_sclerp", "pga_lerp", "motor_spline"]
clips = ["reach", "pivot", "screw", "throw"]
needed = {mode: [len(reduce_keys(*recording(clip), mode, tolerance=0.005)) for clip in clips] for mode in compared}

figure, axes = plt.subplots(figsize=(11, 3.2), layout="constrained")
for place, (mode, counts) in enumerate(needed.items()):
    bars = axes.bar(np.arange(len(clips)) + 0.16 * (place - 2), counts, 0.15, color=COLOURS[mode], label=mode)
    axes.bar_label(bars, padding=2)
axes.set(xticks=range(len(clips)), xticklabels=clips, ylabel="keys within 5 mm")
axes.margins(y=0.12)
axes.legend(ncols=5, loc="lower center", bbox_to_anchor=(0.5, 1.0), frameon=False)
plt.show()
