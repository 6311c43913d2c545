"""Tests of converting values to JSON and arrays, and back."""

import json
from dataclasses import asdict
from pathlib import Path

import numpy as np
import pytest

from rigid_motion_batch.pipeline import values
from rigid_motion_batch.recordings.clips import Clip
from rigid_motion_batch.recordings.rest_bodies import RestBody
from tests.scripts.clips.bodies import swinging_body


def test_a_value_is_read_as_it_was_written(tmp_path: Path) -> None:
    clip = swinging_body()
    values.write(tmp_path / "clip", clip)
    read = values.read(Clip, tmp_path / "clip")
    np.testing.assert_equal(asdict(read), asdict(clip))
    assert isinstance(read.rest_body, RestBody)
    with pytest.raises(ValueError, match="Clip is no RestBody"):
        values.read(RestBody, tmp_path / "clip")


@pytest.mark.parametrize("name", ["os:system", "pathlib:Path", "nowhere:Circle", "Circle"])
def test_what_is_no_class_of_values_is_not_made(tmp_path: Path, name: str) -> None:
    (tmp_path / "value.json").write_text(json.dumps({"$": name}))
    with pytest.raises(ValueError, match="is not a class of values"):
        values.read(Clip, tmp_path / "value")


def test_what_is_no_value_is_refused() -> None:
    assert json.dumps([np.float64(0.5), np.int64(3), np.bool_(True)], default=values.plain) == "[0.5, 3, true]"
    with pytest.raises(TypeError, match="object is not a value"):
        values.plain(object())
    with pytest.raises(TypeError, match="ndarray is not a value"):
        values.plain(np.zeros(2))
