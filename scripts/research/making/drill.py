"""An orthopaedic surgeon's battery drill, as closed shells in millimetres.

Axes as in `motions`: the bit points along +y and lies in the plane x = 0, the pistol grip goes down along -z, the
origin is in the middle of the grip. A selector is on the left, the vents and the irrigation tube are on the right.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from .motions import TIP
from .shells import Shell, X, Y, Z, block, curve, lathe, loft, merged, oval, pad, slab, tube

AXIS_HEIGHT = 1e3 * TIP[2]
BIT_END = 1e3 * TIP[1]


def drill() -> Shell:
    """Return the whole drill."""
    return merged([*_barrel(), *_chuck(), _bit(), *_grip(), *_triggers(), *_battery(), *_left(), *_right()])


def _on_axis(y: ArrayLike) -> np.ndarray:
    return np.multiply.outer(y, Y) + AXIS_HEIGHT * Z


# along y, half width, half height, exponent of the oval
_BARREL = np.array(
    (
        (-38.0, 20.6, 21.6, 2.7),
        (-30.0, 21.4, 22.4, 2.7),
        (-10.0, 22.0, 23.2, 2.7),
        (12.0, 21.6, 22.8, 2.6),
        (32.0, 19.6, 20.6, 2.4),
        (48.0, 17.4, 17.8, 2.2),
        (58.0, 16.6, 16.6, 2.0),
    )
)


def _barrel_rings(stations: ArrayLike) -> np.ndarray:
    return np.stack([oval(_on_axis(y), a * X, b * Z, exponent, 26) for y, a, b, exponent in stations])


def _barrel() -> list[Shell]:
    stations = curve(_BARREL, 11)
    front = [(58.0 + 2.0 * np.sin(t), *(16.6 - 2.0 * (1.0 - np.cos(t)),) * 2, 2.0) for t in np.radians((45.0, 90.0))]
    # Behind a groove, the motor's end cap with its domed back.
    groove = [(-41.0, 18.6, 19.6, 2.7), (-36.0, 18.6, 19.6, 2.7)]
    back = [
        (-40.0 - 14.0 * np.sin(t), 20.4 - 10.0 * (1.0 - np.cos(t)), 21.4 - 10.0 * (1.0 - np.cos(t)), 2.7)
        for t in np.radians((0.0, 22.0, 44.0, 66.0, 90.0))
    ]
    ridge = stations[1:8:2]
    return [
        loft(_barrel_rings([*stations, *front]), "Mode"),
        loft(_barrel_rings(groove), "Metal"),
        loft(_barrel_rings(back), "Rubber"),
        pad(_barrel_rings(ridge), _on_axis(ridge[:, 0]), 4, 9, 1.6, "Rubber"),
    ]


def _chuck() -> list[Shell]:
    collar = (
        (57, 15.4),
        (62.4, 15.4),
        (63.4, 14.4),
        (63.4, 12.6),
        (65.4, 12.6),
        (65.4, 14.6),
        (70.4, 14.6),
        (70.4, 10),
    )
    nose = ((88.0, 12.6), (90.5, 12.6), (91.5, 11.8), (102.5, 7.2), (104.5, 5.0))
    sleeve = []
    for y, radius, depth in ((71.4, 13.0, 0.0), (72.6, 14.4, 0.9), (87.4, 14.4, 0.9), (88.6, 13.0, 0.0)):
        ring = oval(_on_axis(y), radius * X, radius * Z, points=40)
        ring[::2] -= (ring[::2] - _on_axis(y)) * depth / radius
        sleeve.append(ring)
    jaws = []
    for angle in np.radians((90.0, 210.0, 330.0)):
        out = np.cos(angle) * X + np.sin(angle) * Z
        across = np.cross(out, Y)
        ends = ((102.0, 4.6), (109.5, 3.8))
        jaws.append(loft([slab(_on_axis(y) + r * out, 1.7 * out, 1.6 * across, 0.5, 2) for y, r in ends], "Metal"))
    return [
        lathe(_on_axis(0.0), Y, collar, "Metal", 22),
        loft(sleeve, "Metal"),
        lathe(_on_axis(0.0), Y, nose, "Metal", 24),
        *jaws,
    ]


def _bit() -> Shell:
    """Return a twist drill: two flutes that wind to the right, and a point of 118 degrees."""
    radius, points, shank_end, lead = 2.8, 10, 115.0, 24.0
    angle = 2.0 * np.pi * np.arange(points) / points
    tip_start = BIT_END - radius / np.tan(np.radians(59.0))
    fluted = [(y, 1.0, radius) for y in np.linspace(shank_end + 3.0, tip_start, 16)]
    rings = []
    for y, flutes, r in [(100.0, 0.0, radius), (shank_end, 0.0, radius), *fluted, (BIT_END, 1.0, 0.12)]:
        turned = angle - 2.0 * np.pi * max(y - shank_end, 0.0) / lead
        lobes = r * (1.0 - 0.40 * flutes * np.cos(angle) ** 2)
        rings.append(_on_axis(y) + np.outer(lobes * np.cos(turned), X) + np.outer(lobes * np.sin(turned), Z))
    return loft(rings, "Metal")


# height, half width, half depth, centre along y
_GRIP = np.array(
    (
        (52.0, 16.0, 27.0, 4.0),
        (42.0, 15.0, 22.5, 4.5),
        (30.0, 14.4, 19.6, 5.0),
        (14.0, 15.0, 19.4, 2.8),
        (-4.0, 15.6, 19.8, -1.0),
        (-24.0, 14.6, 18.6, -5.2),
        (-40.0, 14.4, 19.0, -8.0),
        (-52.0, 16.5, 22.0, -8.4),
    )
)


def _grip() -> list[Shell]:
    stations = curve(_GRIP, 20)
    rings = []
    for z, a, b, y in stations:
        ring = oval((0.0, y, z), a * X, b * Y, 2.35, 24)
        fingers = 0.9 * np.cos(2.0 * np.pi * (z + 2.0) / 21.0) * np.clip((20.0 - z) / 10.0, 0.0, 1.0)
        ring[:, 1] += fingers * np.clip((ring[:, 1] - y) / b, 0.0, 1.0)
        rings.append(ring)
    rings, centres = np.stack(rings), np.outer(stations[:, 3], Y) + np.outer(stations[:, 0], Z)
    palm, fingers = slice(4, 19, 2), slice(9, 19)
    return [
        loft(rings, "Mode"),
        pad(rings[palm], centres[palm], 13, 22, 1.1, "Rubber"),
        pad(rings[fingers], centres[fingers], 3, 8, 0.9, "Rubber"),
    ]


def _triggers() -> list[Shell]:
    def trigger(middle: float, half: float, width: float, back: float, front: float, material: str) -> Shell:
        """Return a button across the front of the grip, hollow for the finger."""
        rings = []
        for along, inset in ((-1.0, 1.6), (-0.88, 0.3), (-0.4, 0.0), (0.0, 0.0), (0.4, 0.0), (0.88, 0.3), (1.0, 1.6)):
            reach = front + 2.4 * along**2 - inset
            depth = 0.5 * (reach - back)
            centre = (0.0, back + depth, middle + half * along)
            rings.append(slab(centre, (width - 0.5 * inset) * X, depth * Y, 3.0, 3))
        return loft(rings, material)

    return [trigger(31.0, 8.5, 6.6, 14.0, 33.0, "Metal"), trigger(14.0, 6.0, 5.8, 12.0, 27.5, "Rubber")]


def _battery() -> list[Shell]:
    return [
        block((0.0, 0.0, -55.0), (20.0, 35.0, 5.5), 11.0, 3.0, "Mode", steps=4),
        block((0.0, 0.0, -61.5), (18.4, 33.4, 2.5), 10.0, 0.4, "Metal", steps=3),
        block((0.0, 0.0, -72.0), (20.0, 35.0, 9.5), 11.0, 4.0, "Rubber", steps=4),
        block((0.0, 35.0, -70.0), (8.0, 1.8, 3.6), 1.6, 0.8, "Metal", axis=1),
    ]


def _left() -> list[Shell]:
    centre = np.array((-20.5, 2.0, AXIS_HEIGHT))
    dial = ((-2.0, 11.0), (2.2, 11.0), (2.2, 8.8), (1.2, 8.4), (3.8, 7.8), (4.6, 7.0))
    return [
        lathe(centre, -X, dial, "Metal", 22),
        block(centre - 4.6 * X, (1.2, 6.2, 1.6), 1.0, 0.4, "Rubber", axis=0),
        block((-20.6, -24.0, AXIS_HEIGHT), (1.6, 7.0, 3.4), 1.6, 0.4, "Rubber", axis=0),
    ]


def _right() -> list[Shell]:
    vents = [
        block((20.8, -18.0, AXIS_HEIGHT + z), (1.4, 12.0, 1.5), 1.2, 0.4, "Rubber", axis=0) for z in (-8.0, -2.0, 4.0)
    ]
    irrigation = curve(
        (
            (15.5, -30.0, 80.5),
            (16.4, -8.0, 82.0),
            (16.2, 14.0, 81.5),
            (15.2, 36.0, 79.5),
            (15.4, 58.0, 77.0),
            (15.0, 80.0, 76.0),
            (9.6, 101.0, 70.5),
            (5.4, 115.0, 66.5),
        ),
        15,
    )
    clip = ((-3.0, 2.4), (-2.4, 3.2), (2.4, 3.2), (3.0, 2.4))
    clips = [lathe(irrigation[i], irrigation[i + 1] - irrigation[i - 1], clip, "Rubber", 10) for i in (3, 7)]
    return [*vents, tube(irrigation, 1.8, "Metal", 8), *clips]
