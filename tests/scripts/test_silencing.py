"""Tests that output of Python, of the system and of C is silenced, and nothing else."""

import ctypes
import os
import sys

import pytest

from rigid_motion_batch.silencing import silenced


def speak(words: str) -> None:
    """Write to both streams by Python and by the system, and to standard output by C, which buffers it."""
    for stream, descriptor in ((sys.stdout, 1), (sys.stderr, 2)):
        print(f"{words} by Python", file=stream)
        os.write(descriptor, f"{words} by the system\n".encode())
    (ctypes.CDLL("ucrtbase") if os.name == "nt" else ctypes.CDLL(None)).puts(f"{words} by C".encode())


@pytest.mark.parametrize("errors", [False, True])
def test_only_what_is_said_meanwhile_is_hushed(capfd, errors):
    speak("before")
    with silenced(errors=errors):
        speak("meanwhile")
    speak("after")
    with silenced():
        pass
    output, said = capfd.readouterr()
    for words in ("before", "after"):
        for how in ("Python", "the system", "C"):
            assert f"{words} by {how}\n" in output
    assert "meanwhile" not in output
    assert ("meanwhile by Python\nmeanwhile" in said) is not errors
    assert "before by Python" in said
    assert "after by Python" in said


def test_an_error_goes_through_and_the_streams_are_back(capfd):
    with pytest.raises(ZeroDivisionError), silenced(errors=True):
        raise ZeroDivisionError
    print("heard")
    assert capfd.readouterr().out == "heard\n"
