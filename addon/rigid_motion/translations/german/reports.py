"""What was done, as it is reported: behind the name of what it was done to, or how many there are."""

REPORTS = {
    "All up to date": "Alles aktuell",
    "In-betweens of {count} Action refreshed": "Zwischenbilder von {count} Aktion aktualisiert",
    "In-betweens of {count} Actions refreshed": "Zwischenbilder von {count} Aktionen aktualisiert",
    "{count} objects": "{count} Objekte",
    "{count} bones": "{count} Knochen",
    "{count} objects and bones": "{count} Objekte und Knochen",
    "{done} of {count} objects: {summary}. But": "{done} von {count} Objekten: {summary}. Aber",
    "{done} of {count} bones: {summary}. But": "{done} von {count} Knochen: {summary}. Aber",
    "{done} of {count} objects and bones: {summary}. But": "{done} von {count} Objekten und Knochen: {summary}. Aber",
    "and {count} more": "und {count} weitere",
    " and {count} more": " und {count} weitere",
    "Blender's own in-betweens": "Blenders eigene Zwischenbilder",
    "{mode} from frame {frames}": "{mode} ab Einzelbild {frames}",
    "{mode} from frames {frames}": "{mode} ab den Einzelbildern {frames}",
    "{turns} turns more": "{turns} Umdrehungen zusätzlich",
    "baked from frame {first:g} to {last:g}": "gebacken von Einzelbild {first:g} bis {last:g}",
    "{action} by {factor:.0f} %": "{action} um {factor:.0f} %",
    "back to the keys from before baking": "zurück zu den Schlüsselbildern von vor dem Backen",
    "back to the keys from before they were reduced": "zurück zu den Schlüsselbildern von vor dem Reduzieren",
    "the keys from before they were reduced are removed from the file": (
        "die Schlüsselbilder von vor dem Reduzieren sind aus der Datei entfernt"
    ),
    "constraint restored": "Beschränkung wiederhergestellt",
    "exact between frames": "genau zwischen Einzelbildern",
    "exact on whole frames": "genau auf ganzen Einzelbildern",
    "{before} keys became {after}, largest error {error}": (
        "aus {before} Schlüsselbildern wurden {after}, größter Fehler {error}"
    ),
    ", but channels have {after} keys together, and had {before}": (
        ", aber die Kanäle haben zusammen {after} Schlüsselbilder und hatten {before}"
    ),
    ", keys on {frames} frames": ", Schlüsselbilder auf {frames} Einzelbildern",
    ", feet that stand slide {distance}": ", stehende Füße rutschen {distance}",
    "; not promised for what follows constraints or drivers, and hangs on it: {bones}": (
        "; nicht zugesagt für das, was Beschränkungen oder Treibern folgt, und was daran hängt: {bones}"
    ),
    "{name}: {keys} of {all_keys} keys, {size:.0f} of {full:.0f} kB of animation, {error:.2f} mm off at most": (
        "{name}: {keys} von {all_keys} Schlüsselbildern, {size:.0f} von {full:.0f} kB Animation, "
        "höchstens {error:.2f} mm daneben"
    ),
    "; segments: {modes}": "; Segmente: {modes}",
    "{count} poses of objects and bones have keys": "{count} Posen von Objekten und Knochen haben Schlüsselbilder",
    "Nothing came while it was recorded: no keys": "Während der Aufnahme kam nichts: keine Schlüsselbilder",
}
