"""The report: numbers of a run to a page, one file that needs no network. It measures nothing.

- `pages.write_report` writes a page on some clips: the verdict, the viewer linked with the chart of the error over
  time, one table, the films, and the rest folded. A page of one clip among many has a way back to the overview.
- `pages.write_overview` writes the page of many clips, sorted by what matters, that leads to theirs.
- `reduced.write_reduced` writes the page of files whose keys were reduced, with the same viewer.
- `verdict.verdict` is the sentence alone, of `Gathering.numbers()`, for the terminal.

What is shown comes as `ClipResult` (analysis); clips are gone through once, one in memory at a time. A colour is in
`palette` or `templates/page.css`, a chart in `charts`, the sentence in `verdict`, the viewer in `viewer/`; `rendering`
puts templates and scripts together.
"""
