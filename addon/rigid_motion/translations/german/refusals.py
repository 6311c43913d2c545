"""Why something cannot be done, and the way out."""

REFUSALS = {
    "{name} needs a key before and a key after frame {frame:g}: go to a frame between two keys": (
        "{name} braucht ein Schlüsselbild vor und eines nach Einzelbild {frame:g}: auf ein Einzelbild zwischen zwei "
        "Schlüsselbildern gehen"
    ),
    # What is asked for
    "Select keys of location, rotation or scale first": (
        "Zuerst Schlüsselbilder von Position, Rotation oder Skalierung auswählen"
    ),
    "{name}: no key of location, rotation or scale is selected": (
        "{name}: kein Schlüsselbild von Position, Rotation oder Skalierung ist ausgewählt"
    ),
    "{name}: the playhead is not between two keys; move it there, or select keys instead": (
        "{name}: der Abspielkopf ist nicht zwischen zwei Schlüsselbildern; dorthin bewegen oder Schlüsselbilder "
        "auswählen"
    ),
    "{name} has no Action with keys: key it first, or enter a strip (NLA Editor, Tab)": (
        "{name} hat keine Aktion mit Schlüsselbildern: zuerst welche setzen oder einen Streifen öffnen (NLA-Editor, "
        "Tab)"
    ),
    "{name} has no Action with keys to set a mode on: key it first, or enter a strip (NLA Editor, Tab)": (
        "{name} hat keine Aktion mit Schlüsselbildern, die einen Modus haben könnten: "
        "zuerst welche setzen oder einen Streifen öffnen (NLA-Editor, Tab)"
    ),
    "{turns} is no number of turns: give a whole number from -{most} to {most}": (
        "{turns} ist keine Zahl von Umdrehungen: eine ganze Zahl von -{most} bis {most} angeben"
    ),
    "{axis} is no axis of turns: give one of {axes}": (
        "{axis} ist keine Achse von Umdrehungen: eine von {axes} angeben"
    ),
    "{name}: Blender's own in-betweens make no turns more: choose a mode first": (
        "{name}: Blenders eigene Zwischenbilder machen keine zusätzlichen Umdrehungen: zuerst einen Modus wählen"
    ),
    "{name}: key {number} of the channel Turns does not have a number of turns up to {most}: "
    "delete it (Dope Sheet, X), or set the turns anew": (
        "{name}: Schlüsselbild {number} des Kanals Umdrehungen hat keine Zahl bis {most}: "
        "löschen (Dope Sheet, X) oder die Umdrehungen neu setzen"
    ),
    "{name}: leave the strip that is being edited first (NLA Editor, Tab)": (
        "{name}: zuerst den Streifen verlassen, der bearbeitet wird (NLA-Editor, Tab)"
    ),
    "{name} has no constraint to restore: choose a mode for keys of a bone first": (
        "{name} hat keine Beschränkung wiederherzustellen: zuerst einen Modus für Schlüsselbilder eines Knochens wählen"
    ),
    # What is taken
    "{name}: {channel} is driven: remove the driver, or bake it to keys": (
        "{name}: {channel} hat einen Treiber: den Treiber entfernen oder auf Schlüsselbilder backen"
    ),
    "{name}: {channel} has in-betweens that were turned into keys: "
    "delete that channel, and they are made anew (Dope Sheet, X)": (
        "{name}: {channel} hat Zwischenbilder, die zu Schlüsselbildern wurden: "
        "diesen Kanal löschen, dann entstehen sie neu (DopeSheet, X)"
    ),
    "{name}: {channel} is animated already: move that animation to a parent, or to {other} "
    "(Object > Apply > Animated Transforms to Deltas does the reverse)": (
        "{name}: {channel} ist schon animiert: diese Animation auf ein Elternteil oder auf {other} übertragen "
        "(Objekt > Anwenden > Animated Transforms to Deltas tut das Umgekehrte)"
    ),
    "{name} is linked from another file: make it local first (Object > Relations > Make Local)": (
        "{name} ist aus einer anderen Datei verknüpft: zuerst lokal machen (Objekt > Beziehungen > Lokal machen)"
    ),
    "{name} is linked from another file: make an override of it first (Object > Library Override > Make)": (
        "{name} ist aus einer anderen Datei verknüpft: zuerst überschreiben "
        "(Objekt > Bibliothek überschreiben > Erstellen)"
    ),
    "{name} moves by the same Action slot as {leader}, but has another rotation mode, driver or delta transform; "
    "the in-betweens are those of {leader}: give it an Action of its own (Object > Relations > Make Single User)": (
        "{name} wird von demselben Slot einer Aktion bewegt wie {leader}, hat aber einen anderen Rotationsmodus, "
        "einen anderen Treiber oder eine andere Delta-Transformation; die Zwischenbilder sind die von {leader}: "
        "eine eigene Aktion geben (Objekt > Beziehungen > Einzelnen Benutzer erstellen)"
    ),
    "{name} moves by the same Action slot as {leader}, but has another rotation mode, driver or Local Location; "
    "the in-betweens are those of {leader}: give it an Action of its own (Object > Relations > Make Single User)": (
        "{name} wird von demselben Slot einer Aktion bewegt wie {leader}, hat aber einen anderen Rotationsmodus, "
        "einen anderen Treiber oder eine andere „Lokale Position“; die Zwischenbilder sind die von {leader}: "
        "eine eigene Aktion geben (Objekt > Beziehungen > Einzelnen Benutzer erstellen)"
    ),
    # Channels that rigid in-betweens cannot follow
    "{name} turns by axis and angle, which has no rigid in-betweens: "
    "set its rotation mode to Quaternion first (sidebar, Item)": (
        "{name} dreht sich nach Achse und Winkel, wofür es keine starren Zwischenbilder gibt: "
        "zuerst den Rotationsmodus auf Quaternion setzen (Seitenleiste, Gegenstand)"
    ),
    "{name}: {channel} has a modifier of type {modifier}, which rigid in-betweens cannot follow: "
    "mute or remove it, or bake the channel (Graph Editor, Channel)": (
        "{name}: {channel} hat einen Modifikator vom Typ {modifier}, dem starre Zwischenbilder nicht folgen können: "
        "stumm schalten, entfernen oder den Kanal backen (Graph Editor, Kanal)"
    ),
    "{name}: {channel} has a modifier of type {modifier} with a restricted range or influence, which rigid "
    "in-betweens cannot follow: mute or remove it, or bake the channel (Graph Editor, Channel)": (
        "{name}: {channel} hat einen Modifikator vom Typ {modifier} mit begrenztem Bereich oder Einfluss, dem starre "
        "Zwischenbilder nicht folgen können: stumm schalten, entfernen oder den Kanal backen (Graph Editor, Kanal)"
    ),
    "{name}: {channel} has a modifier of type {modifier} that does not just add to it, which rigid in-betweens cannot "
    "follow: have it add (Blend Type or Additive), mute or remove it, or bake the channel (Graph Editor, Channel)": (
        "{name}: {channel} hat einen Modifikator vom Typ {modifier}, der nicht bloß etwas addiert, dem starre "
        "Zwischenbilder nicht folgen können: addieren lassen (Mischtyp oder Additiv), stumm schalten, entfernen oder "
        "den Kanal backen (Graph Editor, Kanal)"
    ),
    "{name}: {channel} and {other} have different Stepped modifiers, and rigid in-betweens hold all channels together: "
    "copy one to the other (Graph Editor, sidebar, Modifiers), or mute them": (
        "{name}: {channel} und {other} haben verschiedene gestufte Modifikatoren, und starre Zwischenbilder halten "
        "alle Kanäle zusammen: einen auf den anderen kopieren (Graph Editor, Seitenleiste, Modifikatoren) oder stumm "
        "schalten"
    ),
    "{name} has Stepped modifiers, or such as add to its channels: mute them while its keys are reduced, or bake them "
    "into the keys first": (
        "{name} hat gestufte Modifikatoren oder solche, die etwas zu Kanälen addieren: beim Reduzieren stumm schalten "
        "oder zuerst in die Schlüsselbilder backen"
    ),
    "{name}: {channel} is sampled and has no keys: turn its samples into keys "
    "(Graph Editor, Channel > Samples to Keys)": (
        "{name}: {channel} ist abgetastet und hat keine Schlüsselbilder: die Abtastwerte zu Schlüsselbildern machen "
        "(Graph Editor, Kanal > Samples to Keys)"
    ),
    "{name} has keys over {frames:.0f} frames, at most {most} can be filled in: delete the keys that are far off": (
        "{name} hat Schlüsselbilder über {frames:.0f} Einzelbilder, höchstens {most} lassen sich füllen: "
        "die weit entfernten Schlüsselbilder löschen"
    ),
    "{name} goes on outside of its keys for all {frames} frames of its scene, at most {most} "
    "can be filled in: shorten the scene, or give the channels constant extrapolation and no cycles": (
        "{name} bewegt sich außerhalb seiner Schlüsselbilder über alle {frames} Einzelbilder der Szene weiter, "
        "höchstens {most} lassen sich füllen: die Szene kürzen oder den Kanälen konstante Extrapolation und keine "
        "Zyklen geben"
    ),
    "{rounds:.0f} rounds of {period:g} frames are too many: give Cycles a count": (
        "{rounds:.0f} Durchläufe von {period:g} Einzelbildern sind zu viele: dem Zyklus eine Anzahl geben"
    ),
    # Numbers
    "key {number} of {channel}": "Schlüsselbild {number} von {channel}",
    "left handle of key {number} of {channel}": "der linke Griff von Schlüsselbild {number} von {channel}",
    "right handle of key {number} of {channel}": "der rechte Griff von Schlüsselbild {number} von {channel}",
    "easing of key {number} of {channel}": "die Abschwächung von Schlüsselbild {number} von {channel}",
    "{name}: {key} is not a finite number: delete it (Dope Sheet, X)": (
        "{name}: {key} ist keine endliche Zahl: löschen (DopeSheet, X)"
    ),
    "{name}: {key} has the frame {number:g}, which no motion can be computed from: delete it (Dope Sheet, X)": (
        "{name}: {key} hat das Einzelbild {number:g}, woraus sich keine Bewegung berechnen lässt: löschen "
        "(DopeSheet, X)"
    ),
    "{name}: {key} has the value {number:g}, which no motion can be computed from: delete it (Dope Sheet, X)": (
        "{name}: {key} hat den Wert {number:g}, woraus sich keine Bewegung berechnen lässt: löschen (DopeSheet, X)"
    ),
    "{name}: {key} has the setting {number:g}, which no motion can be computed from: delete it (Dope Sheet, X)": (
        "{name}: {key} hat die Einstellung {number:g}, woraus sich keine Bewegung berechnen lässt: löschen "
        "(DopeSheet, X)"
    ),
    "{name}: {channel} is not a finite number: set it anew (sidebar, Item)": (
        "{name}: {channel} ist keine endliche Zahl: neu setzen (Seitenleiste, Gegenstand)"
    ),
    "{name}: the keys of {channel} are not in the order of their frames: move one of them and back (Dope Sheet, G)": (
        "{name}: die Schlüsselbilder von {channel} sind nicht in der Reihenfolge ihrer Einzelbilder: "
        "eines bewegen und zurück (DopeSheet, G)"
    ),
    "{name}: a delta transform is not a finite number: set it anew (Object Properties, Delta Transform)": (
        "{name}: eine Delta-Transformation ist keine endliche Zahl: "
        "neu setzen (Objekteigenschaften, Delta-Transformation)"
    ),
    "{name} has keys too large to compute with ({problem}): delete them (Dope Sheet, X)": (
        "{name} hat Schlüsselbilder, die zum Rechnen zu groß sind ({problem}): löschen (DopeSheet, X)"
    ),
    "{name} has a mode that this version does not know: choose another": (
        "{name} hat einen Modus, den diese Version nicht kennt: einen anderen wählen"
    ),
    "{name}: key {number} of the mode channel has no mode that this version knows: "
    "delete it (Dope Sheet, X), or choose a mode for the whole object": (
        "{name}: Schlüsselbild {number} des Modus-Kanals hat keinen Modus, den diese Version kennt: "
        "löschen (DopeSheet, X) oder einen Modus für das ganze Objekt wählen"
    ),
    # Baking
    "The range to bake ends on frame {last:g}, before its start, {first:g}": (
        "Der Bereich zum Backen endet auf Einzelbild {last:g}, vor seinem Start, {first:g}"
    ),
    "the step between baked keys has to be above zero, not {step}": (
        "der Schritt zwischen gebackenen Schlüsselbildern muss über null sein, nicht {step}"
    ),
    "{name} has no rigid in-betweens to bake: choose a mode for its keys first": (
        "{name} hat keine starren Zwischenbilder zu backen: zuerst einen Modus für seine Schlüsselbilder wählen"
    ),
    "{name} has its keys from frame {first:g} to {last:g}: none of them is in that range": (
        "{name} hat seine Schlüsselbilder von Einzelbild {first:g} bis {last:g}: keines davon liegt in diesem Bereich"
    ),
    (
        "{name} cannot get its keys back: their slot was taken out of the Action {action}. "
        "Choose by hand the Action that has them by now"
    ): (
        "{name} kann seine Schlüsselbilder nicht zurückbekommen: ihr Slot wurde aus der Aktion {action} genommen. "
        "Die Aktion, die sie jetzt hat, von Hand wählen"
    ),
    "{name} is not baked, or has another Action by now": (
        "{name} ist nicht gebacken oder hat inzwischen eine andere Aktion"
    ),
    "{name} is not reduced, or has another Action by now": (
        "{name} ist nicht reduziert oder hat inzwischen eine andere Aktion"
    ),
    "{name} was baked since it was reduced: Un-Bake first": (
        "{name} wurde nach dem Reduzieren gebacken: zuerst „Backen aufheben“"
    ),
    "{name} was reduced since it was baked: Restore Keys first": (
        "{name} wurde nach dem Backen reduziert: zuerst „Schlüsselbilder wiederherstellen“"
    ),
    # Fewer keys
    "the tolerance has to be a number above zero, not {tolerance:g}": (
        "die Toleranz muss eine Zahl über null sein, nicht {tolerance:g}"
    ),
    "{name} needs its {count} keys to stay within the tolerance: allow a larger one": (
        "{name} braucht seine {count} Schlüsselbilder, um in der Toleranz zu bleiben: eine größere erlauben"
    ),
    "{name} keeps its {count} keys: its scale changes differently along its axes, which is no "
    "part of a pose; move that animation to a child, or remove keys of the scale by hand": (
        "{name} behält seine {count} Schlüsselbilder: die Skalierung ändert sich entlang der Achsen verschieden, was "
        "kein Teil einer Pose ist; diese Animation auf ein Kind übertragen oder Schlüsselbilder der Skalierung "
        "entfernen"
    ),
    "{name} goes on outside of its keys, and with fewer of them would go elsewhere there: "
    "give its channels constant extrapolation and no cycles, or cycles that all have the same range": (
        "{name} bewegt sich außerhalb seiner Schlüsselbilder weiter und ginge dort mit weniger davon woandershin: "
        "den Kanälen konstante Extrapolation und keine Zyklen geben, oder Zyklen mit demselben Bereich"
    ),
    "{name}: its scale passes zero between two keys: ease those in another way (Dope Sheet, T)": (
        "{name}: die Skalierung geht zwischen zwei Schlüsselbildern durch null: deren Interpolation ändern "
        "(DopeSheet, T)"
    ),
    "{name}: its scale passes zero, and with it the size of all that hangs on it: "
    "reduce the bones above and below it apart from one another": (
        "{name}: die Skalierung geht durch null, und mit ihr die Größe von allem, was daran hängt: "
        "die Knochen darüber und darunter getrennt voneinander reduzieren"
    ),
    "{name} has {count} keys: ask for fewer": "{name} hat {count} Schlüsselbilder: weniger verlangen",
    "{name}: its bones have keys on {frames} frames: ask for fewer key poses": (
        "{name}: die Knochen haben Schlüsselbilder auf {frames} Einzelbildern: weniger Schlüsselposen verlangen"
    ),
    "a motion has 2 keys at least, not {count}": "eine Bewegung hat mindestens 2 Schlüsselbilder, nicht {count}",
    "{name}: its bones need their keys on all of {frames} frames to stay within the tolerance: allow a larger one": (
        "{name}: die Knochen brauchen ihre Schlüsselbilder auf allen {frames} Einzelbildern, um in der Toleranz zu "
        "bleiben: eine größere erlauben"
    ),
    "{name}: its bones need their keys on all of {frames} frames to stay within the tolerance: "
    "allow a larger one, or give each bone keys of its own": (
        "{name}: die Knochen brauchen ihre Schlüsselbilder auf allen {frames} Einzelbildern, um in der Toleranz zu "
        "bleiben: eine größere erlauben oder jedem Knochen eigene Schlüsselbilder geben"
    ),
    "{name} cannot be reduced: {problem}": "{name} lässt sich nicht reduzieren: {problem}",
    "{name} has no keys of location, rotation or scale": (
        "{name} hat keine Schlüsselbilder von Position, Rotation oder Skalierung"
    ),
    "{name} has {count} key of location, rotation or scale": (
        "{name} hat {count} Schlüsselbild von Position, Rotation oder Skalierung"
    ),
    "{name} has {count} keys of location, rotation or scale": (
        "{name} hat {count} Schlüsselbilder von Position, Rotation oder Skalierung"
    ),
    "{has}: there is nothing to reduce": "{has}: es gibt nichts zu reduzieren",
    "{has}, a simulation moves it: bake that first (Object > Rigid Body > Bake to Keyframes)": (
        "{has}, eine Simulation bewegt es: diese zuerst backen (Objekt > Rigid Body > Backe zu Schlüsselbildern)"
    ),
    "{has}, a camera solution moves it: turn that into keys first "
    "(Object Constraint Properties, Constraint to F-Curve)": (
        "{has}, eine Kameralösung bewegt es: diese zuerst zu Schlüsselbildern machen "
        "(Objektbeschränkungseigenschaften, Beschränkung auf F-Kurve)"
    ),
    "{has}, constraints or drivers move it: bake them first (Object > Animation > Bake Action, with Visual Keying)": (
        "{has}, Beschränkungen oder Treiber bewegen es: diese zuerst backen "
        "(Objekt > Animation > Aktion backen, mit Visual Keying)"
    ),
    "{has}, constraints or drivers move it: bake them first (Pose > Animation > Bake Action, with Visual Keying)": (
        "{has}, Beschränkungen oder Treiber bewegen ihn: diese zuerst backen "
        "(Pose > Animation > Aktion backen, mit Visual Keying)"
    ),
    "{has}, its bones have: select those in Pose mode, and reduce theirs": (
        "{has}, aber seine Knochen haben welche: diese im Posenmodus auswählen und ihre reduzieren"
    ),
    "{name} is a bone, and exact between frames anyway": (
        "{name} ist ein Knochen, und zwischen Einzelbildern ohnehin genau"
    ),
    # Live
    "{host} is not on this machine, and Blender is offline: "
    "turn on Preferences > System > Network > Allow Online Access, or use 127.0.0.1": (
        "{host} ist nicht auf diesem Rechner, und Blender ist offline: "
        "Einstellungen > System > Netzwerk > Onlinezugriff erlauben einschalten, oder 127.0.0.1 nehmen"
    ),
    "Port {port} of {host} cannot be listened to, maybe another program does: choose another ({why})": (
        "Port {port} von {host} ist nicht zu haben, vielleicht hat ihn ein anderes Programm: einen anderen wählen "
        "({why})"
    ),
    "{host} is no address that can be sent to ({why})": "{host} ist keine Adresse, an die man senden kann ({why})",
    "Choose a rig first": "Zuerst ein Rig auswählen",
    "{name} has no operator of Rigify's: run its script {script} in the Text Editor first": (
        "{name} hat keinen Befehl von Rigify: zuerst das Skript {script} im Texteditor ausführen"
    ),
}
