"""The bones of Unity's `HumanBodyBones`, which VRM and VMC share: what each hangs on, and what else it is called.

Parents come first; * stands for a side, Left or Right. Other names are in lower case, without side, sign or namespace,
the better ones first.
"""

from __future__ import annotations

BONES: tuple[tuple[str, str, str], ...] = (
    ("Hips", "", "torso hips hip pelvis"),
    ("Spine", "Hips", ""),
    ("Chest", "Spine", ""),
    ("UpperChest", "Chest", ""),
    ("Neck", "UpperChest", "neck neck1 neck01"),
    ("Head", "Neck", "head"),
    ("Jaw", "Head", "jaw jawmaster"),
    ("*Eye", "Head", "eye mastereye"),
    ("*Shoulder", "UpperChest", "shoulder collar clavicle collarbone"),
    ("*UpperArm", "*Shoulder", "upperarm uparm arm"),
    ("*LowerArm", "*UpperArm", "lowerarm forearm loarm"),
    ("*Hand", "*LowerArm", "hand wrist"),
    ("*UpperLeg", "Hips", "upperleg upleg thigh"),
    ("*LowerLeg", "*UpperLeg", "lowerleg lowleg leg shin calf"),
    ("*Foot", "*LowerLeg", "foot ankle"),
    ("*Toes", "*Foot", "toes toe toebase ball"),
    ("*ThumbProximal", "*Hand", ""),
    ("*ThumbIntermediate", "*ThumbProximal", ""),
    ("*ThumbDistal", "*ThumbIntermediate", ""),
    ("*IndexProximal", "*Hand", ""),
    ("*IndexIntermediate", "*IndexProximal", ""),
    ("*IndexDistal", "*IndexIntermediate", ""),
    ("*MiddleProximal", "*Hand", ""),
    ("*MiddleIntermediate", "*MiddleProximal", ""),
    ("*MiddleDistal", "*MiddleIntermediate", ""),
    ("*RingProximal", "*Hand", ""),
    ("*RingIntermediate", "*RingProximal", ""),
    ("*RingDistal", "*RingIntermediate", ""),
    ("*LittleProximal", "*Hand", ""),
    ("*LittleIntermediate", "*LittleProximal", ""),
    ("*LittleDistal", "*LittleIntermediate", ""),
)
