"""What the panel notes on a segment, and how it sums up."""

NOTES = {
    "No Bone Active": "Kein Knochen aktiv",
    "No keys of location, rotation or scale yet": ("Noch keine Schlüsselbilder von Position, Rotation oder Skalierung"),
    "Its bones have keys. Choose their modes in Pose Mode": (
        "Seine Knochen haben Schlüsselbilder. Ihre Modi im Posenmodus wählen"
    ),
    "No segment on this frame": "Kein Segment auf diesem Einzelbild",
    "Moved by strips: enter one to see its segments (NLA Editor, Tab)": (
        "Von Streifen bewegt: einen öffnen, um seine Segmente zu sehen (NLA-Editor, Tab)"
    ),
    "Baked to keys. Un-Bake brings its own keys back": (
        "Auf Schlüsselbilder gebacken. „Backen aufheben“ bringt die eigenen zurück"
    ),
    "The keys have changed since: Live Update is off, in the preferences": (
        "Die Schlüsselbilder haben sich seitdem geändert: „Live-Aktualisierung“ ist in den Einstellungen aus"
    ),
    "The delta transform holds the in-betweens, so this edit of it lasts until the frame changes. "
    "To keep it, edit Delta Transform below": (
        "In der Delta-Transformation sind die Zwischenbilder, daher hält diese Änderung nur bis zum nächsten "
        "Einzelbild. Damit sie bleibt, unten „Delta-Transformation“ bearbeiten"
    ),
    "Exact": "Genau",
    "{distance} off": "{distance} daneben",
    "Strips are blended here, and in-betweens of bones are approximate meanwhile. For exact ones, bake first": (
        "Hier werden Streifen überblendet, und die Zwischenbilder von Knochen sind solange nur ungefähr. "
        "Für genaue zuerst backen"
    ),
    'The constraint "Rigid Motion" was removed, so the in-betweens are Blender\'s own': (
        "Die Beschränkung „Rigid Motion“ wurde entfernt, daher sind die Zwischenbilder Blenders eigene"
    ),
    'The constraint "Rigid Motion" shows another Action, not the one that moves the bone': (
        "Die Beschränkung „Rigid Motion“ zeigt eine andere Aktion, nicht die, die den Knochen bewegt"
    ),
    'The constraint "Rigid Motion" is muted, so the in-betweens are Blender\'s own': (
        "Die Beschränkung „Rigid Motion“ ist stumm, daher sind die Zwischenbilder Blenders eigene"
    ),
    'The constraint "Rigid Motion" has other settings, which put the bone elsewhere': (
        "Die Beschränkung „Rigid Motion“ hat andere Einstellungen, die den Knochen woandershin setzen"
    ),
    'Another constraint comes before "Rigid Motion", which has to be the first': (
        "Vor „Rigid Motion“ kommt eine andere Beschränkung, sie muss aber die erste sein"
    ),
    'The constraint "Rigid Motion" has an influence below 1: a part of Blender\'s in-betweens is left': (
        "Die Beschränkung „Rigid Motion“ hat einen Einfluss unter 1: ein Teil von Blenders Zwischenbildern bleibt"
    ),
    "Blender turns this segment by more than half a turn; the mode takes the short way. "
    "With Turns set to -1 it takes the long one": (
        "Blender dreht in diesem Segment um mehr als eine halbe Umdrehung; der Modus nimmt den kurzen Weg. "
        "Für den langen Weg die Runden auf -1 setzen"
    ),
    "Two angles go by more than half a turn here; whole turns are made about the axis of the larger one. "
    "For both, set a key in between": (
        "Zwei Winkel ändern sich hier um mehr als eine halbe Umdrehung; ganze Umdrehungen gibt es um die Achse des "
        "größeren. Für beide ein Schlüsselbild dazwischen setzen"
    ),
    "{angle} is nearly half a turn: a small change of a key can send it the other way round. "
    "To be sure, set a key in between": (
        "{angle} sind fast eine halbe Umdrehung: eine kleine Änderung eines Schlüsselbilds kann die Richtung umkehren. "
        "Um sicher zu sein, ein Schlüsselbild dazwischen setzen"
    ),
    "The scale is not the same along all axes, and stays Blender's own": (
        "Die Skalierung ist nicht entlang aller Achsen gleich und bleibt Blenders eigene"
    ),
    "Hidden by Viewport Overlays": "Durch die Überlagerungen des Ansichtsfensters ausgeblendet",
    # Rows
    "{turns} turns": "{turns} Runden",
    "{error} at most": "höchstens {error}",
    "{before} to {after} keys": "{before} auf {after} Schlüsselbilder",
    "{frames} with keys": "{frames} mit Schlüsselbildern",
    "slide {distance}": "rutschen {distance}",
    "{after}, recorded {before}": "{after}, aufgenommen {before}",
    "{keys}, {error} off": "{keys}, Fehler {error}",
    "Nothing comes yet": "Noch kommt nichts",
}
