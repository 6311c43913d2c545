"""Rigid Motion: in-betweens that move an object as one rigid body.

`motion` is the mathematics, in NumPy alone; `animation` is Blender's data; `ui` is what an animator sees. Imports go
down only: `ui` knows `animation`, `animation` knows `motion`, and `motion` knows neither.
"""


def register() -> None:
    # Not on top: importing `motion` needs no Blender.
    from . import animation, ui

    animation.register()
    ui.register()


def unregister() -> None:
    from . import animation, ui

    ui.unregister()
    animation.unregister()
