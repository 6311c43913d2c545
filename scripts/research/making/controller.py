"""A hand controller for virtual reality, as closed shells in millimetres.

Axes as in `motions`: it points along +y, its face with the thumb pad looks up along +z, the origin is in the middle of
the handle. It is one for the right hand: the pad and the squeeze button are on the left, the others on the right.
"""

from __future__ import annotations

import numpy as np

from .shells import Shell, X, curve, lathe, loft, merged, oval, pad, rounded_ends, slab, unit

FACE_CENTRE = np.array((0.0, 40.0, 18.0))
FACE = np.array((0.0, -0.17, 0.985))
FACE_AHEAD = np.array((0.0, 0.985, 0.17))
"""The face looks up and a little back, at the thumb."""


def controller() -> Shell:
    """Return the whole controller."""
    return merged([*_handle(), *_head(), *_trigger(), *_ring()])


DOWN_THE_HANDLE = np.array((0.0, -0.919, -0.394))
ACROSS_THE_HANDLE = np.array((0.0, -0.394, 0.919))

# y, z, half width, half height of the handle, from the head to its end
_HANDLE = np.array(
    (
        (40.0, 6.5, 20.0, 7.0),
        (27.0, 4.0, 17.8, 9.5),
        (13.0, 0.5, 15.6, 12.4),
        (-2.0, -3.0, 14.8, 14.6),
        (-18.0, -8.5, 14.8, 15.2),
        (-34.0, -14.0, 14.0, 14.2),
        (-49.0, -20.5, 13.2, 13.2),
    )
)


def _handle() -> list[Shell]:
    def ring(y: float, z: float, a: float, b: float) -> np.ndarray:
        return oval((0.0, y, z), a * X, b * ACROSS_THE_HANDLE, 2.3, 28)

    stations = curve(_HANDLE, 17)
    rings, centres = np.stack([ring(*station) for station in stations]), np.pad(stations[:, :2], ((0, 0), (1, 0)))
    y, z, a, b = stations[-1]
    end = []
    for t in np.radians((-20.0, 0.0, 25.0, 50.0, 75.0)):
        inset = -0.6 + 8.0 * (1.0 - np.cos(max(t, 0.0)))
        end.append(ring(*((y, z) + 9.0 * np.sin(t) * DOWN_THE_HANDLE[1:]), a - inset, b - inset))
    belly, squeeze = slice(6, 16), slice(4, 9)
    return [
        loft(rings, "Mode"),
        loft(end, "Rubber"),
        pad(rings[belly], centres[belly], 16, 25, 1.0, "Rubber"),
        pad(rings[squeeze], centres[squeeze], 11, 15, 1.8, "Metal"),
    ]


def _head() -> list[Shell]:
    def layer(height: float, inset: float) -> np.ndarray:
        return oval(FACE_CENTRE + height * FACE, (25.0 - inset) * X, (26.0 - inset) * FACE_AHEAD, 2.2, 32)

    def on_face(x: float, ahead: float) -> np.ndarray:
        return FACE_CENTRE + x * X + ahead * FACE_AHEAD

    rim = ((-1.0, 13.0), (1.4, 13.0), (2.0, 12.4), (2.0, 11.2), (0.9, 10.8))
    dish = ((-1.0, 10.6), (1.9, 10.6), (2.5, 9.8), (1.7, 4.0), (1.6, 0.6))
    button = ((-1.0, 4.2), (1.9, 4.2), (2.5, 3.4))
    return [
        loft([layer(along - 8.5, inset) for along, inset in rounded_ends(8.5, 4.0)], "Mode"),
        loft([layer(-1.0, 3.4), layer(0.3, 3.4), layer(0.8, 4.0)], "Rubber"),
        lathe(on_face(-6.5, 2.0), FACE, rim, "Metal"),
        lathe(on_face(-6.5, 2.0), FACE, dish, "Rubber"),
        lathe(on_face(13.0, 7.5), FACE, button, "Metal", 14),
        lathe(on_face(14.0, -5.0), FACE, button, "Metal", 14),
        lathe(on_face(5.5, -16.0), FACE, ((-1.0, 2.4), (1.4, 2.4), (1.8, 1.8)), "Metal", 10),
    ]


# y, z, half width, half thickness: from under the head forward and down, hollow for the finger
_TRIGGER = (
    (38.0, 8.0, 10.0, 9.0),
    (48.0, 0.0, 9.6, 7.6),
    (52.5, -8.0, 9.0, 5.4),
    (55.0, -15.0, 8.4, 4.0),
    (59.0, -20.5, 7.6, 3.0),
)


def _trigger() -> list[Shell]:
    path = curve(_TRIGGER, 12)
    ahead = unit(np.gradient(path[:, :2], axis=0))
    path[-1, 2:] -= 1.4
    rings = [
        slab((0.0, y, z), a * X, b * np.array((0.0, -s, c)), 0.75 * b)
        for (y, z, a, b), (c, s) in zip(path, ahead, strict=True)
    ]
    return [loft(rings, "Rubber")]


RING_CENTRE = np.array((3.0, 44.0, 23.0))
RING_AXIS = np.array((0.0, 0.37, 0.929))
RING_AHEAD = np.array((0.0, 0.929, -0.37))


def _ring() -> list[Shell]:
    """Return the tracking ring: a band that is broad in front, where it grows out of the head, and its lights."""

    def out(angle: float) -> np.ndarray:
        return np.cos(angle) * X + np.sin(angle) * RING_AHEAD

    def middle(angle: float) -> np.ndarray:
        return RING_CENTRE + 43.0 * np.cos(angle) * X + 41.0 * np.sin(angle) * RING_AHEAD

    angles = 2.0 * np.pi * np.arange(48) / 48
    band = [oval(middle(t), 2.6 * out(t), (6.6 + 1.6 * np.sin(t)) * RING_AXIS, 2.8, 12) for t in angles]
    light = ((-1.0, 1.6), (0.5, 1.6), (0.8, 1.2))
    lights = [
        lathe(middle(t) + 2.3 * out(t) + height * RING_AXIS, out(t), light, "Metal", 8)
        for t, height in zip(np.radians(np.arange(-48.0, 229.0, 23.0)), (2.4, -2.4) * 7, strict=False)
    ]
    neck = [
        slab(RING_CENTRE + ahead * RING_AHEAD + rise * RING_AXIS, half * X, thick * RING_AXIS, 0.8 * thick)
        for ahead, rise, half, thick in ((12.0, -6.0, 15.0, 6.0), (26.0, -3.5, 14.0, 5.0), (40.0, -0.5, 17.0, 5.0))
    ]
    return [loft(band, "Mode", endless=True), loft(neck, "Mode"), *lights]
