"""A small BVH file of a body that turns while it moves."""

import numpy as np
from scipy.spatial.transform import Rotation

COUNT = 8
TIMES = np.arange(COUNT) / 50.0
POSITIONS = np.round(np.stack((TIMES, np.sin(9.0 * TIMES), 1.0 - TIMES), axis=-1), 4)
ZXY = np.round(Rotation.from_rotvec(np.stack((4.0 * TIMES, TIMES, -TIMES), axis=-1)).as_euler("ZXY", degrees=True), 3)

ARM = """HIERARCHY
ROOT Shoulder
{
    OFFSET 0.0 0.0 0.0
    CHANNELS 6 Xposition Yposition Zposition Zrotation Xrotation Yrotation
    JOINT Elbow
    {
        OFFSET 2.0 0.0 0.0
        CHANNELS 3 Zrotation Xrotation Yrotation
        End Site
        {
            OFFSET 1.0 0.0 0.0
        }
    }
}
MOTION
"""
"""The header of a BVH file with a shoulder and an elbow, up to the number of frames."""


def bvh(times: int = 1) -> str:
    """Return a BVH file with the frames repeated `times` times."""
    lines = [" ".join(f"{number:.5g}" for number in row) for row in np.hstack((POSITIONS, ZXY, ZXY[::-1])).tolist()]
    return "\n".join([f"{ARM}Frames: {COUNT * times}", "Frame Time: 0.02", *(lines * times), ""])
