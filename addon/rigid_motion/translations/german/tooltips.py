"""Descriptions of operators, properties, modes, menus and panels."""

TOOLTIPS = {
    # Modes
    "Blender's own in-betweens: every channel for itself": "Blenders eigene Zwischenbilder: jeder Kanal für sich",
    "The origin runs along a straight line while the object turns at an even speed": (
        "Der Ursprung läuft auf einer geraden Linie, während sich das Objekt gleichmäßig dreht"
    ),
    "The origin runs along a straight line while the bone turns at an even speed": (
        "Der Ursprung läuft auf einer geraden Linie, während sich der Knochen gleichmäßig dreht"
    ),
    "Turns about and slides along one fixed axis in space, both at an even speed": (
        "Dreht sich um eine feste Achse im Raum und gleitet an ihr entlang, beides gleichmäßig"
    ),
    "Nearly the screw motion, slower at the keys and faster half-way": (
        "Fast die Schraubenbewegung, langsamer an den Schlüsselbildern und schneller auf halbem Weg"
    ),
    "The screw motion, by the exponential of the motor's logarithm. The same motion as Screw": (
        "Die Schraubenbewegung, berechnet über den Logarithmus des Motors. Dieselbe Bewegung wie Schraube"
    ),
    "The motor blend, with uniform scale blended along with it. The same motion as Motor Blend where nothing grows": (
        "Die Motor-Mischung, bei der sich gleichmäßige Skalierung mitmischt. Dieselbe Bewegung wie Motor-Mischung, wo "
        "nichts wächst"
    ),
    "Turns, slides and grows at even rates: a screw that widens as the object grows. "
    "The same motion as Screw where nothing grows": (
        "Dreht sich, gleitet und wächst gleichmäßig: eine Schraube, die weiter wird, wenn das Objekt wächst. Dieselbe "
        "Bewegung wie Schraube, wo nichts wächst"
    ),
    "Turns, slides and grows at even rates: a screw that widens as the bone grows. "
    "The same motion as Screw where nothing grows": (
        "Dreht sich, gleitet und wächst gleichmäßig: eine Schraube, die weiter wird, wenn der Knochen wächst. Dieselbe "
        "Bewegung wie Schraube, wo nichts wächst"
    ),
    "Screws that flow into one another: no corner at a key, neither in the path nor in the turning. "
    "The same motion as Screw where there are two keys alone": (
        "Schrauben, die ineinander übergehen: kein Knick am Schlüsselbild, weder im Pfad noch in der Drehung. Dieselbe "
        "Bewegung wie Schraube, wo es nur zwei Schlüsselbilder gibt"
    ),
    "Algebra: dual quaternions": "Algebra: duale Quaternionen",
    "Algebra: motors of projective geometric algebra (PGA)": (
        "Algebra: Motoren der projektiven geometrischen Algebra (PGA)"
    ),
    "Algebra: versors of conformal geometric algebra (CGA)": (
        "Algebra: Versoren der konformen geometrischen Algebra (CGA)"
    ),
    # Poses in between
    "Key a pose on the current frame that is between the key before and the key after it, on the path of the mode": (
        "Auf dem aktuellen Einzelbild eine Pose zwischen dem Schlüsselbild davor und dem danach setzen, auf dem Pfad "
        "des Modus"
    ),
    "Key a more pronounced pose on the current frame: further away from the in-between of the mode": (
        "Auf dem aktuellen Einzelbild eine betontere Pose setzen: weiter weg vom Zwischenbild des Modus"
    ),
    "Key a pose on the current frame that is more like its neighbours: nearer to the mode's in-between": (
        "Auf dem aktuellen Einzelbild eine Pose setzen, die ihren Nachbarn ähnlicher ist: näher am Zwischenbild des "
        "Modus"
    ),
    "How far to go: 0 is the beginning, 1 the end, and beyond that the motion goes on": (
        "Wie weit: 0 ist der Anfang, 1 das Ende, und darüber hinaus geht die Bewegung weiter"
    ),
    # Choosing modes
    "Choose how the selected objects move from key to key": (
        "Wählen, wie sich die ausgewählten Objekte von Schlüsselbild zu Schlüsselbild bewegen"
    ),
    "Choose how the selected bones move from key to key": (
        "Wählen, wie sich die ausgewählten Knochen von Schlüsselbild zu Schlüsselbild bewegen"
    ),
    # Turns
    "Have the selected objects make whole turns more from key to key": (
        "Die ausgewählten Objekte von Schlüsselbild zu Schlüsselbild um ganze Umdrehungen weiter drehen"
    ),
    "Have the selected bones make whole turns more from key to key": (
        "Die ausgewählten Knochen von Schlüsselbild zu Schlüsselbild um ganze Umdrehungen weiter drehen"
    ),
    "Whole turns more than there are without, in the same sense; against it where negative": (
        "Ganze Umdrehungen zusätzlich, im selben Drehsinn; gegen ihn, wenn negativ"
    ),
    "Whole turns that the body makes more between two keys, in the sense in which it turns anyway; against it where "
    "negative. A key of this property decides from its frame on": (
        "Ganze Umdrehungen zwischen zwei Schlüsselbildern zusätzlich, im Drehsinn, der ohnehin da ist; gegen ihn, wenn "
        "negativ. Ein Schlüsselbild dieser Eigenschaft gilt ab seinem Einzelbild"
    ),
    "What the turns are about, in all segments": "Worum die Umdrehungen gehen, in allen Segmenten",
    "What the body turns about by whole turns more, in all segments of its Action": (
        "Worum die zusätzlichen ganzen Umdrehungen gehen, in allen Segmenten der Aktion"
    ),
    "About the axis that a segment turns about anyway, or the local Z axis where it does not turn": (
        "Um die Achse, um die sich ein Segment ohnehin dreht, oder um die lokale Z-Achse, wo es sich nicht dreht"
    ),
    "Always about the local X axis": "Immer um die lokale X-Achse",
    "Always about the local Y axis": "Immer um die lokale Y-Achse",
    "Always about the local Z axis": "Immer um die lokale Z-Achse",
    "Which segments get the turns": "Welche Segmente die Umdrehungen bekommen",
    "All segments get so many turns": "Alle Segmente bekommen so viele Umdrehungen",
    "The segment that the playhead is in. The others keep their turns": (
        "Das Segment, in dem der Abspielkopf ist. Die anderen behalten ihre Umdrehungen"
    ),
    "The segments that the selected keys begin. The others keep their turns": (
        "Die Segmente, die bei den ausgewählten Schlüsselbildern beginnen. Die anderen behalten ihre Umdrehungen"
    ),
    "On: {segments}": "Für: {segments}",
    "What happens between the keys": "Was zwischen den Schlüsselbildern geschieht",
    "What happens between the keys. A key of this property decides from its frame on": (
        "Was zwischen den Schlüsselbildern geschieht. Ein Schlüsselbild dieser Eigenschaft gilt ab seinem Einzelbild"
    ),
    "Which segments get the mode": "Welche Segmente den Modus bekommen",
    "One mode for all segments. Keys of the mode are removed": (
        "Ein Modus für alle Segmente. Schlüsselbilder des Modus werden entfernt"
    ),
    "The segment that the playhead is in. The others keep their modes": (
        "Das Segment unter dem Abspielkopf. Die anderen behalten ihre Modi"
    ),
    "The segments that the selected keys begin. The others keep their modes": (
        "Die Segmente, die an den ausgewählten Schlüsselbildern beginnen. Die anderen behalten ihre Modi"
    ),
    "How the selected objects move from key to key": (
        "Wie sich die ausgewählten Objekte von Schlüsselbild zu Schlüsselbild bewegen"
    ),
    "How the selected bones move from key to key": (
        "Wie sich die ausgewählten Knochen von Schlüsselbild zu Schlüsselbild bewegen"
    ),
    "How objects and bones move on from the selected keys": (
        "Wie sich Objekte und Knochen von den ausgewählten Schlüsselbildern aus weiterbewegen"
    ),
    "How the selected objects or bones move between the two keys that the playhead is between": (
        "Wie sich die ausgewählten Objekte oder Knochen zwischen den beiden Schlüsselbildern um den Abspielkopf bewegen"
    ),
    "One mode for all segments of the objects and bones that are shown": (
        "Ein Modus für alle Segmente der angezeigten Objekte und Knochen"
    ),
    "Give the objects Blender's own in-betweens again, and remove the keys of their modes. "
    "Keys of location, rotation and scale stay": (
        "Den Objekten wieder Blenders eigene Zwischenbilder geben und die Schlüsselbilder ihrer Modi entfernen. "
        "Schlüsselbilder von Position, Rotation und Skalierung bleiben"
    ),
    "Give the bones Blender's own in-betweens again, and remove the keys of their modes. "
    "Keys of location, rotation and scale stay": (
        "Den Knochen wieder Blenders eigene Zwischenbilder geben und die Schlüsselbilder ihrer Modi entfernen. "
        "Schlüsselbilder von Position, Rotation und Skalierung bleiben"
    ),
    "Bring all in-betweens of this file up to date with their keys. "
    "Needed only while Live Update is off, in the preferences of the extension": (
        "Alle Zwischenbilder dieser Datei auf den Stand ihrer Schlüsselbilder bringen. "
        "Nur nötig, solange „Live-Aktualisierung“ in den Einstellungen der Erweiterung aus ist"
    ),
    'Put the constraint "Rigid Motion" back on the selected bones, which shows their in-betweens: '
    "first in the stack, unmuted, with full influence": (
        "Den ausgewählten Knochen die Beschränkung „Rigid Motion“ zurückgeben, die ihre Zwischenbilder zeigt: "
        "als erste im Stapel, nicht stumm, mit vollem Einfluss"
    ),
    "Follow the modes between whole frames as well, for motion blur, strips in slow motion and fast moves: "
    "by a constraint in place of delta transforms": (
        "Den Modi auch zwischen ganzen Einzelbildern folgen, für Bewegungsunschärfe, Streifen in Zeitlupe und "
        "schnelle Bewegungen: durch eine Beschränkung anstelle der Delta-Transformation"
    ),
    "Off, in-betweens are in delta transforms, which are right on whole frames": (
        "Wenn aus, stehen die Zwischenbilder in der Delta-Transformation, die auf ganzen Einzelbildern stimmt"
    ),
    # Baking
    "Put the in-betweens on location, rotation and scale as real keys of type Generated, in a copy of the Action, "
    "for hand-over to programs that read keys only. Un-Bake gives the original back": (
        "Die Zwischenbilder als echte Schlüsselbilder vom Typ „Generated“ in Position, Rotation und Skalierung "
        "schreiben, in eine Kopie der Aktion, für Programme, die nur Schlüsselbilder lesen. "
        "„Backen aufheben“ gibt das Original zurück"
    ),
    "Frames from one baked key to the next. Below 1 there are keys between the frames, for motion blur": (
        "Einzelbilder von einem gebackenen Schlüsselbild zum nächsten. "
        "Unter 1 liegen auch Schlüsselbilder zwischen den Einzelbildern, für Bewegungsunschärfe"
    ),
    "What to bake, widened to whole segments, and those of smooth modes beside them": (
        "Was gebacken wird, erweitert auf ganze Segmente und die weicher Modi daneben"
    ),
    "From the first key of each to its last": "Jeweils vom ersten Schlüsselbild bis zum letzten",
    "The frame range of the scene, or its preview range while that is in use": (
        "Der Bildbereich der Szene, oder ihr Vorschaubereich, solange dieser benutzt wird"
    ),
    "From one frame to another": "Von einem Einzelbild zu einem anderen",
    "First frame to bake": "Erstes Einzelbild, das gebacken wird",
    "Last frame to bake": "Letztes Einzelbild, das gebacken wird",
    "What is between baked keys": "Was zwischen gebackenen Schlüsselbildern ist",
    "Straight lines": "Gerade Linien",
    "Each pose holds until the next key: with a step of 2 the motion is on twos": (
        "Jede Pose bleibt bis zum nächsten Schlüsselbild: bei einem Schritt von 2 läuft die Bewegung auf Zweiern"
    ),
    "Give baked objects the Actions back that they had before, with their own keys and modes": (
        "Gebackenen Objekten die Aktionen zurückgeben, die sie vorher hatten, "
        "mit ihren eigenen Schlüsselbildern und Modi"
    ),
    "Give baked bones the Actions back that they had before, with their own keys and modes": (
        "Gebackenen Knochen die Aktionen zurückgeben, die sie vorher hatten, "
        "mit ihren eigenen Schlüsselbildern und Modi"
    ),
    # Fewer keys
    "Leave only the keys that the motion needs, location and rotation together, in a copy of the Action: "
    "for imported motion capture, baked simulations and solved cameras. Restore Keys gives all of them back": (
        "Nur die Schlüsselbilder lassen, die die Bewegung braucht, Position und Rotation zusammen, in einer Kopie der "
        "Aktion: für importiertes Motion-Capture, gebackene Simulationen und gelöste Kameras. "
        "„Schlüsselbilder wiederherstellen“ gibt alle zurück"
    ),
    "How far off any point may be on any frame, within the radius around what is moved. Of bones that counts "
    "where they get through all that they hang on. To begin with a millimetre, and of a rig 0.3 % of its size, "
    "or 2 % for key poses": (
        "Wie weit irgendein Punkt im Radius um das Bewegte auf irgendeinem Einzelbild abweichen darf. Bei Knochen "
        "zählt der Ort, an den sie durch alles gelangen, woran sie hängen. Anfangs ein Millimeter, bei einem Rig 0,3 "
        "% seiner Größe, für Schlüsselposen 2 %"
    ),
    "What decides how many keys are left": "Wovon abhängt, wie viele Schlüsselbilder bleiben",
    "As few keys as keep the motion within the tolerance": (
        "So wenige Schlüsselbilder, wie die Bewegung in der Toleranz halten"
    ),
    "So many keys, or of a rig key poses, with the smallest error that is found": (
        "So viele Schlüsselbilder, bei einem Rig Schlüsselposen, mit dem kleinsten Fehler, der sich findet"
    ),
    "Keys left of each object, or key poses of each rig. Below is how far off the motion is then": (
        "So viele Schlüsselbilder jedes Objekts oder Schlüsselposen jedes Rigs bleiben. Darunter steht, wie weit die "
        "Bewegung dann abweicht"
    ),
    "How far out from the origin nothing may be off by more: the larger, the more a rotation counts. "
    "At 0 each object has the size of its own bounding box, and each bone its length": (
        "Bis zu welcher Entfernung vom Ursprung nichts weiter abweichen darf: je größer, desto mehr zählt die "
        "Rotation. Bei 0 hat jedes Objekt die Größe seines Begrenzungsrahmens und jeder Knochen seine Länge"
    ),
    "What fills in between the keys that are left, and which keys those are": (
        "Was zwischen den verbliebenen Schlüsselbildern geschieht, und damit, welche das sind"
    ),
    "Then key each segment with the mode that comes closest to the recording there, within the tolerance. "
    "Where one mode meets another the path may turn a corner": (
        "Danach jedem Segment den Modus geben, der dort der Aufnahme am nächsten kommt, innerhalb der Toleranz. "
        "Wo ein Modus auf einen anderen trifft, kann der Pfad einen Knick haben"
    ),
    "Give all bones of a rig keys on the same frames. Otherwise each has its own: fewer keys in all": (
        "Allen Knochen eines Rigs Schlüsselbilder auf denselben Einzelbildern geben. "
        "Sonst hat jeder seine eigenen: insgesamt weniger Schlüsselbilder"
    ),
    "Keep bones that stand on the ground to a quarter of the tolerance while they do": (
        "Knochen, die auf dem Boden stehen, solange auf ein Viertel der Toleranz genau halten"
    ),
    "Give reduced objects all the keys back that they had before, to the last handle": (
        "Reduzierten Objekten alle Schlüsselbilder zurückgeben, die sie vorher hatten, bis zum letzten Griff"
    ),
    "Give reduced bones all the keys back that they had before, to the last handle": (
        "Reduzierten Knochen alle Schlüsselbilder zurückgeben, die sie vorher hatten, bis zum letzten Griff"
    ),
    "Remove the keys from the file that Restore Keys would give back, once the reduced ones are good. "
    "The reduced keys stay as they are": (
        "Die Schlüsselbilder aus der Datei entfernen, die „Schlüsselbilder wiederherstellen“ zurückgäbe, sobald die "
        "reduzierten gut sind. Die reduzierten Schlüsselbilder bleiben, wie sie sind"
    ),
    # The panel
    "Where the object or bone is seen on this frame, with the in-betweens. "
    "The Item tab has Blender's own values, without": (
        "Wo das Objekt oder der Knochen auf diesem Einzelbild zu sehen ist, mit den Zwischenbildern. "
        "Der Reiter „Gegenstand“ hat Blenders eigene Werte, ohne sie"
    ),
    "Where it is seen on this frame: its location with the in-betweens": (
        "Wo es auf diesem Einzelbild zu sehen ist: seine Position mit den Zwischenbildern"
    ),
    "How it is seen turned on this frame: its rotation with the in-betweens": (
        "Wie gedreht es auf diesem Einzelbild zu sehen ist: seine Rotation mit den Zwischenbildern"
    ),
    "How large it is seen on this frame: its scale with the in-betweens": (
        "Wie groß es auf diesem Einzelbild zu sehen ist: seine Skalierung mit den Zwischenbildern"
    ),
    "The delta transforms that the object has of its own, to which the in-betweens are added": (
        "Die Delta-Transformation, die das Objekt selbst hat und zu der die Zwischenbilder hinzukommen"
    ),
    "Which delta transforms in-betweens are in; the object's own are kept here meanwhile": (
        "In welchen Delta-Transformationen Zwischenbilder sind; die eigenen des Objekts werden solange hier aufgehoben"
    ),
    "The object's own delta location, to which the in-betweens are added": (
        "Die eigene Delta-Position des Objekts, zu der die Zwischenbilder hinzukommen"
    ),
    "The object's own delta rotation, to which the in-betweens are added": (
        "Die eigene Delta-Rotation des Objekts, zu der die Zwischenbilder hinzukommen"
    ),
    "The object's own delta scale, by which the in-betweens are multiplied": (
        "Die eigene Delta-Skalierung des Objekts, mit der die Zwischenbilder multipliziert werden"
    ),
    # Paths
    "Draw the paths of the selected objects or bones: Blender's own, and beside it that of a rigid-motion mode. "
    "Of a bone it is the path of its head, or of its tail where the bone only turns. "
    "Parents that move by keys are followed; by constraints they are taken as they are on the current frame": (
        "Die Pfade der ausgewählten Objekte oder Knochen zeichnen: Blenders eigenen und daneben den eines Modus von "
        "Rigid Motion. Bei einem Knochen ist es der Pfad seines Kopfes, oder seines Endes, wo er sich nur dreht. "
        "Elternteilen, die sich durch Schlüsselbilder bewegen, folgt er; solche mit Beschränkungen werden so genommen, "
        "wie sie auf dem aktuellen Einzelbild sind"
    ),
    "Draw the selected objects or bones as they are every few frames, in the mode of the path": (
        "Die ausgewählten Objekte oder Knochen zeichnen, wie sie alle paar Einzelbilder sind, im Modus des Pfads"
    ),
    "Frames from one ghost to the next": "Einzelbilder von einem Geist zum nächsten",
    "The mode that each segment has": "Der Modus, den jedes Segment hat",
    "The mode to draw. Another one than keyed shows what it would do, and changes nothing": (
        "Der Modus, der gezeichnet wird. Ein anderer als der gesetzte zeigt, was er täte, und ändert nichts"
    ),
    "Draw Blender's own path too, in its own color": "Auch Blenders eigenen Pfad zeichnen, in eigener Farbe",
    "Draw how it is turned along its path, by its local axes at some of the ticks": (
        "Zeichnen, wie es entlang seines Pfades gedreht ist: seine lokalen Achsen an einigen der Zeitmarken"
    ),
    "Length of the axes. At 1 they are half as long as the object or bone is": (
        "Länge der Achsen. Bei 1 sind sie halb so lang wie das Objekt oder der Knochen"
    ),
    "Frames from one tick to the next. At 0, as many ticks as can be told apart on the screen": (
        "Einzelbilder von einer Zeitmarke zur nächsten. Bei 0 so viele, wie sich auf dem Bildschirm unterscheiden "
        "lassen"
    ),
    # Preferences
    "What Set Rigid Motion Mode takes where no mode is named: in Search, by a shortcut of your own": (
        "Was „Rigid-Motion-Modus“ nimmt, wo kein Modus genannt ist: in der Suche, mit eigenem Tastenkürzel"
    ),
    "Follow every edit at once. Otherwise in-betweens stay as they are until Refresh In-Betweens": (
        "Jeder Bearbeitung sofort folgen. Sonst bleiben Zwischenbilder, wie sie sind, "
        "bis zu „Zwischenbilder aktualisieren“"
    ),
    "Color of the path as Blender's own in-betweens have it": "Farbe des Pfades mit Blenders eigenen Zwischenbildern",
    "Color of the path as the mode has it": "Farbe des Pfades mit dem Modus",
    "Color of the selected keys on a path. The others are white": (
        "Farbe der ausgewählten Schlüsselbilder auf einem Pfad. Die anderen sind weiß"
    ),
    "Color of the marks that are evenly timed along a path": (
        "Farbe der Marken, die entlang eines Pfades in gleichen Zeitabständen liegen"
    ),
    "Width of the paths": "Breite der Pfade",
    # Why a button is greyed out
    "Select an object with keys first": "Zuerst ein Objekt mit Schlüsselbildern auswählen",
    "Select bones first": "Zuerst Knochen auswählen",
    "No keys of location, rotation or scale are shown here": (
        "Hier werden keine Schlüsselbilder von Position, Rotation oder Skalierung gezeigt"
    ),
    "These objects have Blender's own in-betweens already": "Diese Objekte haben schon Blenders eigene Zwischenbilder",
    "These bones have Blender's own in-betweens already": "Diese Knochen haben schon Blenders eigene Zwischenbilder",
    "These objects and bones have Blender's own in-betweens already": (
        "Diese Objekte und Knochen haben schon Blenders eigene Zwischenbilder"
    ),
    "There are no rigid in-betweens to bake: choose a mode for keys of these objects first": (
        "Es gibt keine starren Zwischenbilder zu backen: zuerst einen Modus für Schlüsselbilder dieser Objekte wählen"
    ),
    "There are no rigid in-betweens to bake: choose a mode for keys of these bones first": (
        "Es gibt keine starren Zwischenbilder zu backen: zuerst einen Modus für Schlüsselbilder dieser Knochen wählen"
    ),
    "There are no rigid in-betweens to bake: choose a mode for keys of these objects and bones first": (
        "Es gibt keine starren Zwischenbilder zu backen: "
        "zuerst einen Modus für Schlüsselbilder dieser Objekte und Knochen wählen"
    ),
    "These objects have Blender's own in-betweens: choose a mode first, or take Blender's Pose > In-Betweens": (
        "Diese Objekte haben Blenders eigene Zwischenbilder: zuerst einen Modus wählen, oder Blenders "
        "Pose > In-Betweens"
    ),
    "These bones have Blender's own in-betweens: choose a mode first, or take Blender's Pose > In-Betweens": (
        "Diese Knochen haben Blenders eigene Zwischenbilder: zuerst einen Modus wählen, oder Blenders "
        "Pose > In-Betweens"
    ),
    "These objects and bones have Blender's own in-betweens: choose a mode first, or take Blender's "
    "Pose > In-Betweens": (
        "Diese Objekte und Knochen haben Blenders eigene Zwischenbilder: zuerst einen Modus wählen, oder Blenders "
        "Pose > In-Betweens"
    ),
    "Copy the pose of the selected bones as you see it, with the in-betweens. "
    "Until the frame changes their channels have it, too": (
        "Die Pose der ausgewählten Knochen kopieren, wie sie zu sehen ist, mit den Zwischenbildern. "
        "Bis zum nächsten Bildwechsel haben sie auch ihre Kanäle"
    ),
    "Create a pose asset of the selected bones as you see them, with the in-betweens. "
    "Until the frame changes their channels have that pose, too": (
        "Ein Posen-Asset der ausgewählten Knochen erstellen, wie sie zu sehen sind, mit den Zwischenbildern. "
        "Bis zum nächsten Bildwechsel haben ihre Kanäle diese Pose"
    ),
    "No selected bone is on an in-between: Blender's own operator does the same": (
        "Kein ausgewählter Knochen ist auf einem Zwischenbild: Blenders eigener Befehl tut dasselbe"
    ),
    "Switch the parent of a control of Rigify, which stays where you see it. "
    "Rigify's own operator takes Blender's in-between": (
        "Das Elternteil eines Steuerknochens von Rigify wechseln, der bleibt, wo er zu sehen ist. "
        "Rigifys eigener Befehl nimmt Blenders Zwischenbild"
    ),
    "What the control is to hang on": "Woran der Steuerknochen hängen soll",
    "No selected bone has both a parent that Rigify can switch and in-betweens of a mode": (
        "Kein ausgewählter Knochen hat ein Elternteil, das Rigify wechseln kann, und Zwischenbilder eines Modus"
    ),
    "None of these objects is baked": "Keines dieser Objekte ist gebacken",
    "None of these bones is baked": "Keiner dieser Knochen ist gebacken",
    "None of these objects and bones is baked": "Keines dieser Objekte und keiner dieser Knochen ist gebacken",
    "None of these objects has more than two keys. Constraints, drivers and simulations are turned into keys first "
    "(Object > Animation > Bake Action, with Visual Keying)": (
        "Keines dieser Objekte hat mehr als zwei Schlüsselbilder. Beschränkungen, Treiber und Simulationen werden "
        "zuerst zu Schlüsselbildern (Objekt > Animation > Aktion backen, mit Visual Keying)"
    ),
    "None of these bones has more than two keys. Constraints, drivers and simulations are turned into keys first "
    "(Pose > Animation > Bake Action, with Visual Keying)": (
        "Keiner dieser Knochen hat mehr als zwei Schlüsselbilder. Beschränkungen, Treiber und Simulationen werden "
        "zuerst zu Schlüsselbildern (Pose > Animation > Aktion backen, mit Visual Keying)"
    ),
    "None of these objects and bones has more than two keys. Constraints, drivers and simulations are turned into keys "
    "first (Object > Animation > Bake Action, with Visual Keying)": (
        "Keines dieser Objekte und keiner dieser Knochen hat mehr als zwei Schlüsselbilder. Beschränkungen, Treiber "
        "und Simulationen werden zuerst zu Schlüsselbildern (Objekt > Animation > Aktion backen, mit Visual Keying)"
    ),
    "The keys of these objects are not reduced": "Die Schlüsselbilder dieser Objekte sind nicht reduziert",
    "The keys of these bones are not reduced": "Die Schlüsselbilder dieser Knochen sind nicht reduziert",
    "The keys of these objects and bones are not reduced": (
        "Die Schlüsselbilder dieser Objekte und Knochen sind nicht reduziert"
    ),
    "What is selected is exact between frames anyway": ("Was ausgewählt ist, ist zwischen Einzelbildern ohnehin genau"),
    "None of these objects lacks its constraint": "Keinem dieser Objekte fehlt seine Beschränkung",
    "None of these bones lacks its constraint": "Keinem dieser Knochen fehlt seine Beschränkung",
    "None of these objects and bones lacks its constraint": (
        "Keinem dieser Objekte und Knochen fehlt seine Beschränkung"
    ),
    "These keys were baked since: Un-Bake first": (
        "Diese Schlüsselbilder wurden seitdem gebacken: zuerst „Backen aufheben“"
    ),
    "These keys were reduced since: Restore Keys first": (
        "Diese Schlüsselbilder wurden seitdem reduziert: zuerst „Schlüsselbilder wiederherstellen“"
    ),
    # glTF
    (
        "Write a GLB file with only the keys that its animations need: no joint, nor any point within the radius of "
        "it, is off by more than the tolerance in any viewer. All other options are those that glTF 2.0 was exported "
        "with last"
    ): (
        "Eine GLB-Datei mit nur den Schlüsselbildern schreiben, die ihre Animationen brauchen: kein Gelenk und kein "
        "Punkt innerhalb des Radius ist in irgendeinem Betrachter um mehr als die Toleranz daneben. Alle anderen "
        "Einstellungen sind die, mit denen glTF 2.0 zuletzt exportiert wurde"
    ),
    "How far off any point within the radius of any joint or object may be in the world, at any time": (
        "Wie weit ein Punkt innerhalb des Radius eines Gelenks oder Objekts zu irgendeiner Zeit in der Welt daneben "
        "sein darf"
    ),
    "How far from its joint a point may be for which the tolerance holds": (
        "Wie weit ein Punkt, für den die Toleranz gilt, von seinem Gelenk entfernt sein darf"
    ),
    "Export selected objects only": "Nur ausgewählte Objekte exportieren",
    "Enable the add-on glTF 2.0 format first": "Zuerst das Add-on glTF 2.0 format aktivieren",
    # Live
    "Bodies from other programs, over a network: shown, recorded as keys, and sent": (
        "Körper aus anderen Programmen, über ein Netz: gezeigt, als Schlüsselbilder aufgenommen und gesendet"
    ),
    "Show bodies that other programs send to this port: as new objects, or on the rig below": (
        "Körper zeigen, die andere Programme an diesen Port senden: als neue Objekte oder am Rig darunter"
    ),
    "Close the port. Everything stays as it is shown; a recording that is not finished is given up": (
        "Den Port schließen. Alles bleibt, wie es gezeigt wird; eine Aufnahme, die nicht beendet ist, wird verworfen"
    ),
    "Keep what comes from now on, from the current frame on, as keys": (
        "Was von jetzt an kommt, ab dem aktuellen Einzelbild als Schlüsselbilder behalten"
    ),
    "Give each body that was recorded an Action with its keys. Reduce Keys then makes them fewer": (
        "Jedem Körper, der aufgenommen wurde, eine Aktion mit seinen Schlüsselbildern geben. Mit Reduzieren werden sie "
        "weniger"
    ),
    "Fill the table in anew: which bone of the rig each joint moves, as far as names tell": (
        "Die Tabelle neu ausfüllen: welchen Knochen des Rigs jedes Gelenk bewegt, soweit die Namen es sagen"
    ),
    "Send the selected rigs as VMC performers and all other selected objects as VMC trackers, as they are seen": (
        "Die ausgewählten Rigs als Darsteller und alle anderen ausgewählten Objekte als Tracker von VMC senden, so wie "
        "man sie sieht"
    ),
    "Send nothing any more, and close the port": "Nichts mehr senden und den Port schließen",
    "Where to listen: 127.0.0.1 for programs on this machine alone, 0.0.0.0 for others, too": (
        "Wo zugehört wird: 127.0.0.1 nur für Programme auf diesem Rechner, 0.0.0.0 auch für andere"
    ),
    "The UDP port that other programs send to": "Der UDP-Port, an den andere Programme senden",
    "By how much the picture of VMC is behind, so that it goes on evenly where data comes unevenly": (
        "Um wie viel das Bild von VMC zurückliegt, damit es gleichmäßig weitergeht, wo Daten ungleichmäßig kommen"
    ),
    "The armature that a body drives, by the names of its bones. Without, it appears as a new one": (
        "Das Skelett, das ein Körper bewegt, nach den Namen seiner Knochen. Ohne erscheint er als ein neues"
    ),
    "Which of several bodies drives the rig. Without, the first that comes": (
        "Welcher von mehreren Körpern das Rig bewegt. Ohne der erste, der kommt"
    ),
    "The bone that this joint moves; none where it is empty": (
        "Der Knochen, den dieses Gelenk bewegt; keiner, wenn das Feld leer ist"
    ),
    "What fills in between the keys that are recorded": "Was zwischen die Schlüsselbilder der Aufnahme kommt",
    "How far off any bone may be where a recording of VMC, which comes on every frame, is thinned": (
        "Wie weit ein Knochen daneben sein darf, wo eine Aufnahme von VMC, das jedes Einzelbild schickt, ausgedünnt "
        "wird"
    ),
    "The machine that VMC is sent to": "Der Rechner, an den VMC gesendet wird",
    "The UDP port that VMC is sent to": "Der UDP-Port, an den VMC gesendet wird",
    "Select objects or rigs first": "Zuerst Objekte oder Rigs auswählen",
}
