"""The report: turns the numbers of a run into an HTML page, one file that needs no network. Measures nothing.

- `pages.write_report` writes a page about a few clips: the verdict, the viewer linked with the chart of the error
    over time, one table, the films, and the rest folded. A page of one clip among many links back to the overview.
  - `pages.write_overview` writes the page of many clips, most important first, with a link to each clip's page.
- `reduced.write_reduced` writes the page of files whose keys were reduced, with the same viewer.
- `verdict.verdict` returns only the sentence, from `Gathering.numbers()`, for the terminal.

The input is `ClipResult`s (analysis); clips are iterated once, with one in memory at a time. Colours are in
`palette` or `templates/page.css`, charts in `charts`, the sentence in `verdict`, the viewer in `viewer/`; `rendering`
puts templates and scripts together.
"""
