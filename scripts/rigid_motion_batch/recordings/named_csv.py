"""CSV with named columns in any order, as loggers write them: `t,x,y,z,qx,qy,qz,qw`, `timestamp_ms,pos_x,...,rot_w`.

`column_names` says which names are known, and `columns` how they become bodies: several in a row, or one of several
that another column names. The quaternion's order is that of the names; other columns are ignored. Separated by commas,
semicolons or tabs; with the latter two, numbers may have a decimal comma. The program's own files
(`t,x,y,z,qw,qx,qy,qz`) are such CSVs.
"""

from __future__ import annotations

from itertools import chain
from operator import itemgetter
from pathlib import Path

from .columns import columns_found, known_in, layout_of
from .options import ReadingOptions
from .recordings import Selection, Trajectory, TrajectoryError
from .tables import HeaderLine, header_lines, lines_of_words
from .tracks import read_below


def read(path: Path, selection: Selection, options: ReadingOptions) -> list[Trajectory]:
    """Read the requested bodies. One without a name of its own has the file's."""
    header = _find_header(path, options)
    way_out = f"name the column that tells them apart, --columns device=NAME (found {columns_found(header.cells)})"
    return read_below(selection, options, header, f"{way_out}, or split the file")


def _find_header(path: Path, options: ReadingOptions) -> HeaderLine:
    """Find the line that names all that is needed: one of the first, or the only one further down.

    Where none does, TrajectoryError says what the nearest lacks.
    """
    first = [line.of_rows() for line in header_lines(path)]
    result: list[HeaderLine] = []
    problems: list[tuple[int, TrajectoryError]] = []
    for line in chain(first, lines_of_words(path, first[-1].number)):
        try:
            layout_of(line, options)
        except TrajectoryError as error:
            problems.append((known_in(line), error))
            continue
        if line in first:
            return line
        result.append(line)
    if len(result) == 1:
        return result[0]
    if result:
        numbers = " and ".join(str(line.number) for line in result[:2])
        problem = f"lines {numbers} both name columns, with others before them"
        raise result[0].error(problem, "make a file of each table, without what is before it")
    known, nearest = max(problems, key=itemgetter(0))
    raise nearest if known else problems[len(first) - 1][1]
