"""The extension's page: what its pictures show is what happens, and they can be shown anywhere."""

import re
import struct

import bpy
import numpy as np
import pytest
from mathutils import Vector

from assets import make_listing
from research.making import listing

LISTING = make_listing.ASSETS / "listing"

HAND = Vector((1.0, 2.0, 3.0))


def grips(mode: str | None) -> np.ndarray:
    """Where the grip of the hammer is on each frame, from the hand, in lengths of the hammer."""
    hammer = bpy.data.objects.new("Hammer", None)
    bpy.context.scene.collection.objects.link(hammer)
    return np.array([pose @ listing.GRIP - HAND for pose in listing.swing(hammer, HAND, mode)]) / listing.HANDLE_LENGTH


def test_by_the_screw_the_grip_stays_in_the_hand_which_it_leaves_by_blenders_own_in_betweens(extension):
    assert np.linalg.norm(grips(None), axis=1).max() > 0.4
    assert np.linalg.norm(grips("dq_sclerp"), axis=1).max() < 1e-5


def test_the_icon_is_seen_on_any_ground(empty_file):
    """It is transparent around, leaves a margin, and has both bright and dark in it."""
    image = bpy.data.images.load(str(LISTING / "icon.png"))
    pixels = np.array(image.pixels).reshape(256, 256, 4)
    alpha = pixels[..., 3]
    assert max(alpha[0].max(), alpha[-1].max(), alpha[:, 0].max(), alpha[:, -1].max()) == 0.0
    assert 0.2 < (alpha > 0.5).mean() < 0.7
    brightness = pixels[alpha > 0.9, :3].mean(axis=1)
    assert brightness.min() < 0.15
    assert brightness.max() > 0.9


@pytest.mark.parametrize(("name", "size"), [("icon.png", (256, 256)), ("featured.png", (1920, 1080))])
def test_pictures_have_the_sizes_that_the_site_asks_for_and_say_nothing_of_when_and_where_they_were_made(name, size):
    picture, place, kinds = (LISTING / name).read_bytes(), 8, set()
    assert struct.unpack(">II", picture[16:24]) == size
    while place < len(picture):
        length, kind = struct.unpack_from(">I4s", picture, place)
        kinds.add(kind)
        place += length + 12
    assert kinds <= {b"IHDR", b"IDAT", b"IEND", b"pHYs", b"sBIT"}


def test_the_text_is_as_long_as_people_read():
    assert 150 <= len(re.findall(r"[\w'-]+", (LISTING / "description.md").read_text(encoding="utf-8"))) <= 300
