"""Simulated mouse and keyboard of a Blender window, for scenarios that run inside that Blender.

A scenario is a generator. Blender only queues the events; it handles them and draws when the scenario yields. So every
action is written `yield from hand.press("G")`; a plain `yield` lets Blender handle it, `yield 0.5` waits half a second.
Blender has to be started with --enable-event-simulate, which also blocks the real mouse.
"""

from __future__ import annotations

import os
import time
import traceback
from collections.abc import Callable, Generator, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import TypeVar

import bpy
import numpy as np

from tests.gui import places
from tests.gui.pictures import part_of, read_screen, write_png
from tests.gui.places import Box, Place

T = TypeVar("T")
Steps = Generator[float | None, None, T]
"""The actions of a hand: a generator of seconds to wait (None: as long as Blender needs), with a result."""

TURNS = 4
"""Turns of Blender's main loop between two steps: an event may cause others, and each turn ends with drawing."""

PAUSE = 0.1
"""Seconds between two steps: a pressed button flashes for a moment before it acts."""

QUICK, SMOOTH = "OFF", "8"
"""Anti-aliasing of 3D Views: during scenarios, and in pictures for pages, where it is Blender's default.

With SMOOTH Blender draws a view eight times: without a graphics card that would be two thirds of the time.
"""

SHOWN = Path(__file__).resolve().parents[2] / "docs" / "window"
"""The pictures on pages of the documentation, as SCENARIO/NAME.png."""

PATIENCE = 30.0
"""Seconds to wait for a condition, since other windows and tests keep the processors busy as well."""

PIE_RADIUS = 150
"""Pixels from the centre of a pie menu to one of its items."""

FOLDED_PANEL = 25
"""Pixels from the header of a folded panel to the next header."""

FOLDED = 50
"""Height in pixels: the redo panel is higher than this once it is unfolded."""

COMPASS = {
    "W": (-1, 0),
    "E": (1, 0),
    "S": (0, -1),
    "N": (0, 1),
    "NW": (-1, 1),
    "NE": (1, 1),
    "SW": (-1, -1),
    "SE": (1, -1),
}
"""The directions of a pie menu, in the order of its items."""

DIGITS = ("ZERO", "ONE", "TWO", "THREE", "FOUR", "FIVE", "SIX", "SEVEN", "EIGHT", "NINE")
"""Blender's names of the digit keys."""


class Hand:
    """Mouse and keyboard of Blender's first window, and a camera for pictures of it.

    Parameters
    ----------
    pictures
        Folder for the pictures.
    """

    def __init__(self, pictures: Path) -> None:
        self.pictures = pictures
        self.place: Place = (self.window.width // 2, self.window.height // 2)

    @property
    def window(self) -> bpy.types.Window:
        """The window, looked up each time: opening a file replaces it."""
        return bpy.context.window_manager.windows[0]

    def area(self, kind: str) -> bpy.types.Area:
        """Return the largest area of this type in the window."""
        return places.area(self.window, kind)

    def open_animation_workspace(self) -> Steps[None]:
        """Open the Animation workspace, with the viewport next to the Dope Sheet."""
        self.window.workspace = bpy.data.workspaces["Animation"]
        yield from self.wait_until(lambda: self.window.screen.name == "Animation", "the Animation workspace opens")

    # Mouse

    def hover(self, place: Place) -> Steps[None]:
        """Move the mouse to a place. Keys go to the area under the mouse."""
        self.place = place
        self._event("MOUSEMOVE", "NOTHING")
        yield 0  # nothing flashes when the mouse moves

    def glide(self, place: Place, steps: int = 5) -> Steps[None]:
        """Move the mouse to a place in steps along a straight line."""
        (x, y), (to_x, to_y) = self.place, place
        for step in range(1, steps + 1):
            yield from self.hover((x + (to_x - x) * step // steps, y + (to_y - y) * step // steps))

    def click(self, place: Place | None = None, button: str = "LEFTMOUSE", **modifiers: bool) -> Steps[None]:
        """Click at a place, or where the mouse is."""
        if place:
            yield from self.hover(place)
        yield from self.press(button, **modifiers)

    # Keyboard

    def press(self, key: str, **modifiers: bool) -> Steps[None]:
        """Press a key and release it: `press("Z", ctrl=True)`. Keys are named as in `bpy.types.Event.type`."""
        held = [f"LEFT_{name.upper()}" for name, down in modifiers.items() if down]
        for name in held:
            self._event(name, "PRESS", **modifiers)
        self._event(key, "PRESS", **modifiers)
        self._event(key, "RELEASE", **modifiers)
        for name in reversed(held):
            self._event(name, "RELEASE")
        yield

    def type(self, text: str) -> Steps[None]:
        """Type a text into the active field, or a number during a drag."""
        for character in text:
            # Characters without a key come from F24, which has no shortcut: only the character counts.
            key = DIGITS[int(character)] if character.isdigit() else "F24"
            self._event(key, "PRESS", unicode=character)
            self._event(key, "RELEASE")
        yield

    def enter(self, text: str, place: Place | None = None) -> Steps[None]:
        """Replace the value of the field at a place, or under the mouse."""
        if place:
            yield from self.hover(place)
        yield from self.press("RET")
        yield from self.press("A", ctrl=True)
        yield from self.type(text)
        yield from self.press("RET")

    def _event(self, kind: str, value: str, **details: object) -> None:
        x, y = self.place
        self.window.event_simulate(type=kind, value=value, x=x, y=y, **details)

    # Menus and buttons

    def open_menu(self, area: bpy.types.Area, menu: str) -> Steps[None]:
        """Open a menu of an area's header by clicking along it. Menus are named by class: "DOPESHEET_MT_key"."""
        header = places.region(area, "HEADER")
        with _drawings_of(menu) as drawings:
            for x in range(header.x + 30, header.x + header.width, 35):
                yield from self.click((x, header.y + header.height // 2))
                if drawings:
                    return
                yield from self.press("ESC")
        raise LookupError(f"no click into the header of the {area.type} opens {menu}")

    def choose(self, label: str) -> Steps[None]:
        """Choose an entry of the open menu, or of its submenus, by typing its name."""
        yield from self.press("SPACE")
        yield from self._find_and_run(label)

    def choose_row(self, row: int) -> Steps[None]:
        """Choose a row, from 0, of the open list of a property's values, which cannot be found by typing."""
        yield from self.press("HOME")
        for _ in range(row):
            yield from self.press("DOWN_ARROW")
        yield from self.press("RET")

    def search(self, label: str) -> Steps[None]:
        """Run the first result of F3 for a text, in the area under the mouse."""
        yield from self.press("F3")
        yield from self._find_and_run(label)

    def _find_and_run(self, label: str) -> Steps[None]:
        yield 0.2
        yield from self.type(label)
        yield 0.3
        yield from self.press("RET")

    def pie(
        self, key: str, direction: str, picture: str | None = None, box: Box | None = None, **modifiers: bool
    ) -> Steps[None]:
        """Hold the key of a pie menu, move in a direction of `COMPASS`, take a picture if it is named, and release."""
        (x, y), (right, up) = self.place, COMPASS[direction]
        self._event(key, "PRESS", **modifiers)
        yield 0.3
        yield from self.glide((x + right * PIE_RADIUS, y + up * PIE_RADIUS))
        yield 0.2
        if picture:
            yield from self.picture(picture, box)
        self._event(key, "RELEASE", **modifiers)
        yield

    def unfold_redo_panel(self, area: bpy.types.Area) -> Steps[bpy.types.Region]:
        """Unfold the redo panel of an area if it is folded; return its region."""
        redo = places.region(area, "HUD")
        if redo.height < FOLDED:
            yield from self.click(places.centre(redo))
            yield from self.wait_until(lambda: redo.height > FOLDED, "the redo panel unfolds")
        return redo

    def open_sidebar(self, area: bpy.types.Area, category: str) -> Steps[None]:
        """Open the sidebar of an area at the tab of this name."""
        sidebar = next(region for region in area.regions if region.type == "UI")
        if not area.spaces.active.show_region_ui:
            yield from self.hover(places.centre(places.region(area)))
            yield from self.press("N")
        yield from self.wait_until(lambda: sidebar.width > 1, "the sidebar opens")
        yield
        sidebar.active_panel_category = category
        yield

    def find_button(self, area: bpy.types.Area, kind: str, what: str, *, narrow: bool = False) -> Steps[Place]:
        """Return the place of the button of a property or operator in a region, found by moving the mouse across it.

        Parameters
        ----------
        kind
            The region's type: "UI" for a sidebar, "HEADER" for a header.
        what
            The end of the property's data path ("rigid_motion.mode"), or the operator ("action.bake_keys").
        narrow
            True if the button is no wider than its icon.
        """
        part = places.region(area, kind)
        flat = part.height < 40  # a header has one row of narrow buttons, a sidebar many rows of wide ones
        right, down = 15 if flat or narrow else part.width // 4, part.height // 2 if flat else 15
        columns = range(part.x + right, part.x + part.width, right)
        if right > 15:  # most buttons of a sidebar extend to its middle
            columns = sorted(columns, key=lambda x: abs(x - part.x - part.width // 2))
        for x in columns:
            for y in range(part.y + part.height - down, part.y, -down):
                yield from self.hover((x, y))
                if f".{self._button_under_mouse(area, part)}".endswith(f".{what}"):
                    return x, y
        raise LookupError(f"{what} has no button in the {kind} region of the {area.type}")

    def _button_under_mouse(self, area: bpy.types.Area, part: bpy.types.Region) -> str:
        """Return the data path of the property, or the operator, of the button under the mouse; "" without a button."""
        copy_command = bpy.ops.ui.copy_python_command_button
        with bpy.context.temp_override(window=self.window, area=area, region=part):
            owned = getattr(bpy.context, "property", None)
            if owned:
                return owned[1]
            # Blender names a button's operator through the clipboard only: "bpy.ops.action.bake_keys()".
            if not copy_command.poll():
                return ""
            copy_command()
        return bpy.context.window_manager.clipboard.partition("(")[0]

    # Screen

    def wait_until(self, condition: Callable[[], object], what: str, seconds: float = PATIENCE) -> Steps[None]:
        """Wait for a condition to become true. AssertionError with `what` if it does not in time."""
        end = time.monotonic() + seconds
        while not condition():
            assert time.monotonic() < end, f"not within {seconds} s: {what}"
            yield

    def look(self, edges: str = QUICK) -> Steps[np.ndarray]:
        """Redraw, and return the pixels of the screen as in `tests.gui.pictures`."""
        system = bpy.context.preferences.system
        system.viewport_aa = edges
        for area in self.window.screen.areas:
            area.tag_redraw()
        yield 0.5  # another process owns the screen, and may be late
        screen = os.environ.get("BLENDER_GUI_SCREEN")
        pixels = read_screen(Path(screen).read_bytes()) if screen else self._screenshot()
        system.viewport_aa = QUICK
        return pixels

    def picture(self, name: str, box: Box | None = None) -> Steps[np.ndarray]:
        """Save the screen, or the part of it in a box, as NAME.png; return its pixels."""
        shown = (SHOWN / self.pictures.name / f"{name}.png").is_file()
        pixels = yield from self.look(SMOOTH if shown else QUICK)
        if box:
            pixels = part_of(pixels, box)
        write_png(self.pictures / f"{name}.png", pixels)
        return pixels

    def _screenshot(self) -> np.ndarray:
        path = self.pictures / ".screenshot.png"
        with bpy.context.temp_override(window=self.window):
            bpy.ops.screen.screenshot(filepath=str(path))
        image = bpy.data.images.load(str(path))
        width, height = image.size
        values = np.empty(width * height * image.channels, np.float32)
        image.pixels.foreach_get(values)
        bpy.data.images.remove(image)
        path.unlink()
        return np.rint(values.reshape(height, width, -1)[::-1, :, :3] * 255).astype(np.uint8)


@contextmanager
def _drawings_of(menu: str) -> Iterator[list[str]]:
    """Yield a list that grows whenever Blender draws this menu, that is, when the menu opens."""
    drawings: list[str] = []

    def draw(self: bpy.types.Menu, context: bpy.types.Context) -> None:
        drawings.append(menu)

    kind = getattr(bpy.types, menu)
    kind.append(draw)
    try:
        yield drawings
    finally:
        kind.remove(draw)


def run(scenario: Steps[None], hand: Hand, seconds: float, done: Callable[[str | None], None]) -> None:
    """Run a scenario step by step from a timer of Blender.

    Parameters
    ----------
    seconds
        Time limit of the scenario, which is then stopped.
    done
        Called at the end with the error as a text, None without one. After an error there is a picture "failed".
    """
    end = time.monotonic() + seconds
    turns = 0
    failure: str | None = None

    def step() -> float | None:
        nonlocal turns, scenario, failure
        turns = (turns + 1) % TURNS
        if turns:
            return 0.0
        try:
            late = time.monotonic() > end
            wait = scenario.throw(TimeoutError(f"not done after {seconds} s")) if late else next(scenario)
        except StopIteration:
            done(failure)
            return None
        except Exception:
            if failure is None:
                # Take the picture first: the screen may tell more than the traceback.
                failure, scenario = traceback.format_exc(), hand.picture("failed")
                return 0.0
            done(failure)
            return None
        return PAUSE if wait is None else wait

    # A timer that is not persistent ends when a scenario opens a file.
    bpy.app.timers.register(step, first_interval=0.5, persistent=True)
