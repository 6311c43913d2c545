"""German, in the words of Blender's own German interface.

A keyframe is a Schlüsselbild, a bone a Knochen, a strip a Streifen, a constraint a Beschränkung; the location is the
Position, to bake is backen. Menus that Blender has in English stay English here, for that is what users look for.

labels    names of things, by context        tooltips   descriptions
notes     what the panel notes               refusals   why something cannot be done, and the way out
reports   what was done
"""

from __future__ import annotations

from bpy.app.translations import contexts

from ...animation.properties import OWN_WORDS
from .labels import LABELS, OF_OPERATORS, OF_OWN_CONTEXT
from .notes import NOTES
from .refusals import REFUSALS
from .reports import REPORTS
from .tooltips import TOOLTIPS

BY_CONTEXT = {
    contexts.default: LABELS | TOOLTIPS | NOTES | REFUSALS | REPORTS,
    contexts.operator_default: OF_OPERATORS,
    OWN_WORDS: OF_OWN_CONTEXT,
}

TEXTS = {(context, english): german for context, texts in BY_CONTEXT.items() for english, german in texts.items()}
"""All of it, as Blender wants it."""
