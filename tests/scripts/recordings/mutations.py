"""Damage to text files, as by transfers, editors, exporters and malice: random, but the same every time.

Every mutation is a function of a file's bytes and a random generator that returns other bytes.
"""

import re
from collections.abc import Callable
from random import Random

PLAIN_NUMBERS = """
0 -0 -1 1e308 -1e308 1.8e308 1e-308 5e-324 1e100 9e99 1e39 1e41 1e9999 -1e-9999 nan -nan NaN nan(0x1)
inf -Infinity null true - + . 1. .5 1e 0x10 0b1 1_000 1,5 1;5 1d5 1j (1+0j) 1.5.5 --1 1% $1 #1
1e9 1000000000 2147483648 4294967296 9223372036854775807 9223372036854775808 -9223372036854775808
"""

NUMBERS = (*PLAIN_NUMBERS.split(), *("", " ", "1 5", "\u0663", "\u00bd", "\uff11", '"1"', "'1'", "9" * 400, "9" * 5000))
"""Texts that replace numbers."""

PLAIN_WORDS = r"""
* .. ../../x { } {} [ ] [] , ; : " "" ' # \ \u0000 \ud800 null true --> <script>
t qw s scale time timestamp p_RS_R_x [ns] HIERARCHY ROOT JOINT OFFSET CHANNELS MOTION Frames: Xposition
2026-11-22T10:00:00Z 9999-99-99T99:99:99 10:00:00.5 +25:00
timestamp_ms t_ns x_mm pos_x left_x rot_w device hand roll euler_x
Zrotation poses rotation Rotation Position Type XYZ Quaternion Meters
"""

WORDS = (
    *PLAIN_WORDS.split(),
    *("#timestamp [ns]", "Format Version", "Rigid Body", "Length Units", "End Site", "Frame Time:"),
    *("CHANNELS 7", "CHANNELS 1e9", "Frames: 1000000000", "Frames: 1e9"),
    *("", "\t", "\0", "\x1b[2J", "\u202e", "\ufeff", "\U0001f600", "x" * 300, "[" * 3000, "{" * 50, "}" * 50, '"' * 3),
)
"""Texts that replace words or go between them; some reader gives each of them a meaning."""

LINE_ENDS = (b"\n", b"\r\n", b"\r", b"\n\n", b"\x0b", b"\x0c", b"\x1c", b"\xc2\x85", b"\xe2\x80\xa8", b" \n", b",\n")

NUMBER = re.compile(rb"[-+]?\d+(?:\.\d+)?(?:[eE][-+]?\d+)?")
WORD = re.compile(rb"[^\s,;:\"]+")

Mutation = Callable[[bytes, Random], bytes]


def mutated(content: bytes, chance: Random) -> bytes:
    """Return the content with one to four kinds of damage."""
    for _ in range(chance.choice((1, 1, 1, 2, 2, 3, 4))):
        content = chance.choice(MUTATIONS)(content, chance)
    return content


def in_place(content: bytes, chance: Random) -> bytes:
    """Return the content with some bytes changed: of binary files, a changed length would be rejected too early."""
    for _ in range(chance.choice((1, 1, 2, 4))):
        content = change_bytes(content, chance)
    return content


def change_bytes(content: bytes, chance: Random) -> bytes:
    changed = bytearray(content)
    for _ in range(chance.choice((1, 2, 10)) if changed else 0):
        changed[chance.randrange(len(changed))] = chance.randrange(256)
    return bytes(changed)


def repeat_piece(content: bytes, chance: Random) -> bytes:
    first = chance.randint(0, len(content))
    piece = content[first : first + chance.randint(1, 40)]
    return content[:first] + piece * chance.choice((2, 3, 201)) + content[first + len(piece) :]


def truncate(content: bytes, chance: Random) -> bytes:
    return content[: chance.randint(0, len(content))]


def empty(content: bytes, chance: Random) -> bytes:
    return chance.choice(
        (b"", b" ", b"\n", b"\n" * 1000, b"\xef\xbb\xbf", b"\xff\xfe", b"\0" * 100, b"#\n#", b"{}", b"[]")
    )


def replace_numbers(content: bytes, chance: Random) -> bytes:
    return _replace(NUMBER, NUMBERS, content, chance)


def replace_words(content: bytes, chance: Random) -> bytes:
    return _replace(WORD, WORDS, content, chance)


def _replace(pattern: re.Pattern[bytes], instead: tuple[str, ...], content: bytes, chance: Random) -> bytes:
    result = list(pattern.finditer(content))
    for match in sorted(chance.sample(result, min(len(result), chance.choice((1, 1, 3)))), key=re.Match.start)[::-1]:
        content = content[: match.start()] + chance.choice(instead).encode() + content[match.end() :]
    return content


def delete_or_repeat_line(content: bytes, chance: Random) -> bytes:
    lines = content.splitlines(keepends=True)
    if lines:
        row = chance.randrange(len(lines))
        lines[row : row + 1] = [lines[row]] * chance.choice((0, 0, 2, 300))
    return b"".join(lines)


def change_line_ends(content: bytes, chance: Random) -> bytes:
    every = chance.random() < 0.5
    end = chance.choice(LINE_ENDS)
    return b"".join(
        line.rstrip(b"\r\n") + (end if every else chance.choice(LINE_ENDS))
        for line in content.splitlines(keepends=True)
    )


def change_encoding(content: bytes, chance: Random) -> bytes:
    encoding = chance.choice(("utf-8-sig", "utf-16", "utf-16-le", "utf-16-be", "utf-32", "latin-1", "utf-7", "cp037"))
    text = content.decode("utf-8", errors="replace")
    if encoding == "latin-1":
        text = text.replace("e", "é")
    encoded = text.encode(encoding, errors="replace")
    if chance.random() < 0.2:
        encoded = encoded[:-1]
    return b"\xff\xfe" + encoded if chance.random() < 0.1 else encoded


def nest(content: bytes, chance: Random) -> bytes:
    """Insert nested brackets."""
    first, last = chance.choice(((b"[", b"]"), (b"{", b"}"), (b'{"poses":', b"}"), (b"JOINT x {", b"}"), (b"(", b")")))
    depth = chance.choice((1, 2, 100, 20_000))
    place = chance.choice((0, chance.randint(0, len(content))))
    return content[:place] + first * depth + content[place:] + last * chance.choice((0, depth))


MUTATIONS: tuple[Mutation, ...] = (
    *(change_bytes, repeat_piece, truncate, empty),
    *(replace_numbers, replace_numbers, replace_words),
    *(delete_or_repeat_line, delete_or_repeat_line, change_line_ends, change_encoding, nest),
)
