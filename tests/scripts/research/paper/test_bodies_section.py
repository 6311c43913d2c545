"""The section on bodies says what is in the files, and chooses its words by it."""

from __future__ import annotations

import re
from dataclasses import replace
from pathlib import Path

import pytest

from research.paper.bodies import ALONE, BODY, IN_PARENTS, LIMBS, MODES, Apart, Body, ErrorOfBody, KeysOfBody, Limb
from research.paper.bodies_section import FILES, HEADING, BodyResults, bodies_section, quoted
from research.paper.page import with_section, write_page
from research.paper.results import Results
from rigid_motion_batch.rows import write_rows

FACTORS = {"lerp_slerp": 1.0, "dq_sclerp": 1.25, "pga_lerp": 1.25, "motor_spline": 0.5}

JOINTS = {"hands": ("LeftHand", "RightHand"), "feet": ("LeftFoot", "RightFoot"), "heads": ("Head",)}

LIMB_ROWS = [
    Limb(body, limb, joint, number, 7, "")
    for body in ("fast", "slow")
    for limb, joints in JOINTS.items()
    for number, joint in enumerate(joints)
]


def keys(body: str, of: str, joint: str, mode: str, decimation: str, rate: int) -> KeysOfBody:
    share = FACTORS[mode] * (0.8 if decimation == "adaptive" else 1.0)
    return KeysOfBody(body, of, joint, mode, decimation, rate, 10 * rate, 10 * rate * share)


def errors(body: str, of: str, joint: str, way: str, mode: str, rate: int) -> ErrorOfBody:
    size = FACTORS[mode] * (0.9 if way == ALONE else 1.0) / rate
    return ErrorOfBody(body, of, joint, way, mode, rate, 10 * rate, 0.0321 * size, 0.02 * size, 1.0, 0.3 * size)


RATES = {"fast": (30, 20, 15, 12, 8, 5), "slow": (15, 12, 8, 5)}

WHOLE = [(body, BODY, "") for body in RATES]

PARTS = [(row.body, row.limb, row.joint) for row in LIMB_ROWS]

ROWS: dict[str, list] = {
    "bodies": [
        Body("fast", "fast.bvh", 31, 1201, 10.0, 120.0, 1, 0.0),
        Body("slow", "slow.fbx", 66, 301, 10.0, 30.0, 1, 0.0123),
        Body("torn", "torn.bvh", left_out="torn.bvh: no HIERARCHY"),
    ],
    "limbs": LIMB_ROWS,
    "needed": [
        keys(*part, mode, decimation, rate)
        for part in WHOLE + PARTS
        for mode in MODES
        for decimation in ("uniform", "adaptive")
        for rate in RATES[part[0]]
    ],
    "errors": [
        errors(*part, way, mode, rate)
        for part in WHOLE + PARTS
        for way in ((IN_PARENTS,) if part[1] == BODY else (IN_PARENTS, ALONE))
        for mode in MODES
        for rate in (5, 10)
    ],
    "apart": [
        Apart("fast", 5, 0.0, "Neck", 0.0, 0.0345, 0.0345, 1e-9, 0.345),
        Apart("slow", 5, 0.0021, "Thigh", 0.0032, 0.0123, 0.0123, 1e-9, 0.246),
    ],
}


def section(**changed: list) -> str:
    """With some of the rows changed."""
    return "\n".join(bodies_section(BodyResults(**(ROWS | changed))))


def of_kind(rows: list, **wanted: object) -> list:
    return [row for row in rows if all(getattr(row, name) == value for name, value in wanted.items())]


def test_numbers_of_the_files_are_in_the_section():
    text = section()
    for number in (
        "`fast` (31 joints, 10.0 s of 120 samples a second)",
        "30.0 (0%)",
        "24.0 (20%)",
        "37.5 (25% more)",
    ):
        assert number in text
    for number in ("6.42; 1.250; 1.250; 0.500", "25.0% more", "50.0% less", "12.3", "34.5", "246.0", "`Thigh`"):
        assert number in text
    assert "| slow |  |  | 150; 188; 188; 75 |" in text
    assert "- Left out: `torn`, torn.bvh: no HIERARCHY." in text


def test_every_file_is_on_the_page_and_halved_numbers_change_it():
    before = section()
    for name, rows in ROWS.items():
        halved = [
            replace(row, **{key: value / 2.0 for key, value in vars(row).items() if isinstance(value, float)})
            for row in rows
        ]
        if name != "limbs":
            assert section(**{name: halved}) != before, name
    carried = [replace(limb, chain=3 + limb.number) for limb in LIMB_ROWS]
    assert "3 to 4 keys take the place of one" in section(limbs=carried)
    assert "7 keys take the place of one" in before


def test_it_says_at_which_rates_which_bodies_count():
    text = section()
    assert "counted are at 30 and 20 key poses a second `fast`; all of them at 15, 12, 8 and 5." in text
    assert "| 30/s, 1 body | 20/s, 1 body | 15/s, 2 bodies |" in text
    assert "At 15 a second there is hardly more than one sample between two key poses of `slow`" in text
    only = of_kind(ROWS["needed"], body="fast")
    assert "counted are" not in section(bodies=ROWS["bodies"][:1], needed=only)


def test_modes_with_the_same_cells_share_a_row_and_a_sentence():
    text = section()
    assert "| `dq_sclerp` = `pga_lerp` |" in text
    assert "- Multivectors by LERP (`pga_lerp`): as many as `dq_sclerp`." in text
    needed = [replace(row, keys=row.keys / 2.0) if row.mode == "pga_lerp" else row for row in ROWS["needed"]]
    assert "as many as `dq_sclerp`" not in section(needed=needed)


@pytest.mark.parametrize(
    ("share", "verdict"),
    [
        (0.3, "It is there at 30, 20, 15 and 12 a second."),
        (0.62, "It is there at 30 a second."),
        (1.1, "Nowhere here is it the paper's."),
    ],
)
def test_the_verdict_is_that_of_the_numbers(share: float, verdict: str):
    needed = [
        replace(row, keys=share * row.reference_keys) if (row.mode, row.of) == ("dq_sclerp", "feet") else row
        for row in ROWS["needed"]
    ]
    text = section(needed=needed)
    assert verdict in text
    assert ("(feet alone)" in text) == (share < 1.25)


def test_what_no_keys_reach_is_a_dash_and_on_some_bodies_it_says_on_how_many():
    def without(*names: str) -> str:
        return section(
            needed=[
                replace(row, keys=float("inf")) if row.mode == "dq_sclerp" and row.body in names else row
                for row in ROWS["needed"]
            ]
        )

    assert "18.8 (25% more; 1 of 2)" in without("slow")
    assert "| `dq_sclerp` | - | - | - | - | - | - |" in without("slow", "fast")
    for text in (without("slow"), without("slow", "fast")):
        assert "nan" not in text
        assert "inf" not in text


def test_where_joints_only_turn_screw_and_slerp_are_called_one_motion():
    text = section()
    assert "all joints but the roots of `fast` move by at most 0 mm: screw and SLERP are the same motion there." in text
    assert "In `slow` a joint moves by up to 12.3 mm" in text
    assert "two differ by up to 2.1 mm in its parent's space (`Thigh`) and by 3.2 mm in that of the roots" in text
    moved = [replace(row, parents_m=0.5) for row in ROWS["apart"]]
    assert "are the same motion" not in section(apart=moved)


def test_whose_the_difference_is_follows_the_numbers():
    assert "is the roots' on every body" in section()
    assert "up to 34.5 mm on `fast` at 5/s" in section()
    assert "nowhere more than 10% of that" in section()
    carried = [replace(row, carried_m=0.1) for row in ROWS["apart"]]
    assert "is that of the joints below the roots on every body" in section(apart=carried)
    assert "in 1 of 2 cells" in section(apart=[*carried[:1], *ROWS["apart"][1:]])
    nothing = [replace(row, parents_m=0.0, carried_m=0.0, roots_m=0.0, all_m=0.0) for row in ROWS["apart"]]
    assert "a screw is nothing else" in section(apart=nothing)


def test_that_both_turn_alike_is_told_only_where_it_is_measured():
    assert "both turn alike" in section()
    assert "turned from one another by up to 0.5°" in section(apart=[replace(r, turned_deg=0.5) for r in ROWS["apart"]])


def test_which_way_is_nearer_follows_the_numbers():
    assert (
        "- Hands are closer to the recording alone, under every mode. Alone, the error at 5 and 10 a second is 10.0% "
        in section()
    )
    rows = [replace(row, rms_shell_m=9.0) if row.way == ALONE else row for row in ROWS["errors"]]
    assert "- Feet are closer to the recording through their joints, under every mode." in section(errors=rows)
    rows = [
        replace(row, rms_shell_m=9.0) if row.way == ALONE and (row.mode, row.rate) != ("pga_lerp", 5) else row
        for row in ROWS["errors"]
    ]
    assert (
        "- Heads are closer to the recording alone under `pga_lerp` at 5/s, and through their joints otherwise."
        in section(errors=rows)
    )


def test_whom_a_screw_helps_alone_follows_the_numbers():
    assert "at every rate for none, and larger for all." in section()
    assert "| fast | 1.250; 1.250 | 1.250; 1.250 | 1.250; 1.250 |" in section()
    rows = [
        replace(row, rms_shell_m=row.rms_shell_m / 2.0)
        if (row.body, row.of, row.way, row.mode) == ("slow", "feet", ALONE, "dq_sclerp")
        else row
        for row in ROWS["errors"]
    ]
    text = section(errors=rows)
    assert "at every rate for feet of `slow`, and larger for hands of `fast`, feet of `fast`" in text
    assert "| slow | 1.250; 1.250 | 0.625; 0.625 | 1.250; 1.250 |" in text
    same = [replace(row, rms_shell_m=0.01) for row in ROWS["errors"]]
    assert "at every rate for none, and larger for none." in section(errors=same)


def test_a_pose_before_the_motion_is_spoken_of():
    assert "first sample" not in section()
    jumping = [replace(ROWS["bodies"][0], skipped=1), ROWS["bodies"][1]]
    assert "- Without its first sample, a pose from which it jumps into the motion: `fast`." in section(bodies=jumping)


def test_a_body_without_hands_has_the_other_parts():
    text = section(limbs=[], **{name: of_kind(ROWS[name], of=BODY) for name in ("needed", "errors")})
    assert "by their names: none (`fast` and `slow`)" in text
    assert "alone**" not in text
    assert "## " in text


def test_names_that_somebody_else_gave_are_text_and_nothing_else():
    hostile = "a`|b\n# <i>\x1b[31m"
    assert quoted(hostile) == "`a'/b\\n# <i>\\x1b[31m`"
    assert quoted("") == "`?`"
    limbs = [replace(limb, joint=hostile) for limb in LIMB_ROWS]
    apart = [replace(row, joint=hostile) for row in ROWS["apart"]]
    left_out = Body("torn", "torn", left_out="<b>[x](y)\n# `z`")
    text = section(limbs=limbs, apart=apart, bodies=[*ROWS["bodies"][:2], left_out])
    assert [line for line in text.splitlines() if line.startswith("#")] == [HEADING]
    assert "\x1b" not in text
    assert "<b>" not in text
    columns = {len(re.findall(r"(?<!\\)\|", line)) for line in text.splitlines() if "Thigh" in line}
    assert columns <= {0}


def test_bodies_none_of_which_counts_are_named_and_no_bodies_are_no_section():
    text = section(bodies=ROWS["bodies"][2:], limbs=[], needed=[], errors=[], apart=[])
    assert "- Left out: `torn`" in text
    assert "**" not in text
    assert bodies_section(BodyResults()) == []


def test_a_body_too_slow_for_everything_says_so():
    text = section(needed=[], errors=[], apart=[])
    assert "None of them has two samples to a key pose" in text


def test_files_are_read_back_as_they_were_written(tmp_path: Path):
    for (name, kind), rows in zip(FILES.items(), ROWS.values(), strict=True):
        write_rows(tmp_path / name, kind, rows)
    assert "\n".join(bodies_section(BodyResults.read(tmp_path.joinpath, FILES))) == section()
    assert bodies_section(BodyResults.read(tmp_path.joinpath, [])) == []
    assert HEADING in write_page(Results.read(tmp_path.joinpath, FILES))


# -- in a page ---------------------------------------------------------------------------------------------------------

PAGE = "# Paper\n\nWords.\n\n## Why\n\nBows.\n\n## Running time\n\nns\n\n## Files\n\n| a |\n"


def test_the_section_goes_where_it_belongs_and_the_rest_stays():
    text = with_section(PAGE, f"{HEADING}\n\nNew.\n")
    assert text == PAGE.replace("## Running", f"{HEADING}\n\nNew.\n\n## Running")


def test_a_section_is_replaced_by_a_later_one():
    first = with_section(PAGE, f"{HEADING}\n\nOld.\n\n**Table**\n\n| b |\n")
    assert with_section(first, f"{HEADING}\n\nNew.\n") == with_section(PAGE, f"{HEADING}\n\nNew.\n")


def test_at_the_end_of_a_page_there_is_room_too():
    first = with_section("# Paper\n", f"{HEADING}\n\nOld.\n")
    assert first == f"# Paper\n\n{HEADING}\n\nOld.\n"
    assert with_section(first, f"{HEADING}\n\nNew.\n") == f"# Paper\n\n{HEADING}\n\nNew.\n"


def test_it_is_where_the_page_has_it():
    results = replace(
        Results({"NumPy": "9"}, [], [], [], [], [], [], [], [], [], frozenset()), of_bodies=BodyResults(**ROWS)
    )
    whole = write_page(results)
    assert with_section(write_page(replace(results, of_bodies=BodyResults())), section()) == whole


def test_kinds_of_limbs_are_those_of_the_study():
    assert set(JOINTS) == set(LIMBS)
