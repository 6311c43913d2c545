"""Rigid Motion: in-betweens that move an object as one rigid body.

`motion` is the mathematics, in NumPy alone. `streams` sends and receives bodies over a network. `animation` works on
Blender's data, and `live` moves it by streams. `ui` is the user interface, and `translations` translates it.
Each package imports only those named before it; `motion` imports none.
"""

__version__ = "0.1.0"


def register() -> None:
    # Not at the top: importing `motion` needs no Blender.
    from . import animation, translations, ui

    translations.register()
    animation.register()
    ui.register()


def unregister() -> None:
    from . import animation, translations, ui

    ui.unregister()
    animation.unregister()
    translations.unregister()
