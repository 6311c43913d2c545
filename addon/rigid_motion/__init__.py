"""Rigid Motion: in-betweens that move an object as one rigid body.

`motion` is the mathematics, in NumPy alone; `animation` is Blender's data; `ui` is what an animator sees, and
`translations` is that in other languages. Imports go down only: each knows those before it, and `motion` none.
"""


def __getattr__(name: str) -> str:
    """Read `__version__` from the manifest, which lies in this folder, or at the top of a checkout."""
    if name != "__version__":
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    import tomllib
    from pathlib import Path

    package = Path(__file__).resolve().parent
    for folder in (package, package.parents[1]):
        if (manifest := folder / "blender_manifest.toml").is_file():
            return tomllib.loads(manifest.read_text(encoding="utf-8"))["version"]
    raise AttributeError(f"{package} has no blender_manifest.toml, which tells the version: install it again")


def glTF2ExportUserExtension() -> object:
    """Return what tells which clips to leave out: the glTF exporter of Blender looks for this name in add-ons."""
    from .animation.gltf_export import LeaveOut

    return LeaveOut()


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
