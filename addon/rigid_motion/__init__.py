"""Rigid Motion: in-betweens that move an object as one rigid body.

`motion` is the mathematics, in NumPy alone, and `streams` bodies over a network; `animation` is Blender's data, and
`live` what of it moves by streams; `ui` is what an animator sees, and `translations` is that in other languages.
Imports go down only: each knows those before it, and `motion` none.
"""

__version__ = "0.1.0"


def register() -> None:
    # Not on top: importing `motion` needs no Blender.
    from . import animation, translations, ui

    translations.register()
    animation.register()
    ui.register()


def unregister() -> None:
    from . import animation, translations, ui

    ui.unregister()
    animation.unregister()
    translations.unregister()
