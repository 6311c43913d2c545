"""Films in pages: on the site, pictures become films; in the Markdown files, they stay pictures.

A PNG next to an MP4 of the same name becomes that film, with the PNG as its poster. So does a picture that links to a
film. Other links to films stay links, and the film is inserted after their paragraph.
"""

from __future__ import annotations

from pathlib import Path, PurePosixPath

from docutils import nodes
from sphinx import addnodes
from sphinx.application import Sphinx
from sphinx.util.osutil import relative_uri


class video(nodes.General, nodes.Element):
    """A film: `film` and `poster` are paths in docs/ (the poster may be empty), `label` describes the content.

    The class name is lower case like docutils' own nodes.
    """


def setup(app: Sphinx) -> dict[str, bool]:
    app.add_node(video, html=(visit_video, None))
    app.connect("doctree-read", show_films)
    app.connect("doctree-resolved", copy_films)
    return {"parallel_read_safe": True, "parallel_write_safe": False}


def make_video(film: str, poster: str, label: str) -> video:
    """Return a film node with these paths in docs/."""
    return video(film=film, poster=poster, label=label)


def show_films(app: Sphinx, doctree: nodes.document) -> None:
    """Replace pictures by their films, and insert films below links to them."""
    shown = set()
    for image in list(doctree.findall(nodes.image)):
        place, film = image, str(PurePosixPath(image["uri"]).with_suffix(".mp4"))
        link = _enclosing(image, addnodes.download_reference)
        if link and (linked := _film_of(app, link)):
            place, film = link, linked
        elif not (image["uri"].endswith(".png") and (Path(app.srcdir) / film).is_file()):
            continue
        place.replace_self(make_video(film, image["uri"], image.get("alt", "")))
        shown.add(film)
    for link in list(doctree.findall(addnodes.download_reference)):
        film = _film_of(app, link)
        if film and film not in shown:
            shown.add(film)
            paragraph = _enclosing(link, nodes.paragraph)
            label = paragraph.astext().replace("\n", " ")
            paragraph.parent.insert(paragraph.parent.index(paragraph) + 1, make_video(film, "", label))


def _film_of(app: Sphinx, link: nodes.Element) -> str | None:
    """Return the path in docs/ of the film that a link leads to, or None."""
    return app.env.relfn2path(link["reftarget"], app.env.docname)[0] if link["reftarget"].endswith(".mp4") else None


def _enclosing(node: nodes.Node, kind: type[nodes.Element]) -> nodes.Element | None:
    """Return the closest node of a kind that contains a node, or the node itself, or None."""
    while node is not None and not isinstance(node, kind):
        node = node.parent
    return node


def copy_films(app: Sphinx, doctree: nodes.document, docname: str) -> None:
    """Make the builder copy films and posters to its folder of pictures."""
    for node in doctree.findall(video):
        for path in filter(None, (node["film"], node["poster"])):
            app.builder.images.setdefault(path, path.replace("/", "-"))


def visit_video(translator: nodes.NodeVisitor, node: video) -> None:
    builder = translator.builder
    page = builder.get_target_uri(builder.current_docname)

    def url(path: str) -> str:
        return relative_uri(page, f"{builder.imagedir}/{builder.images[path]}")

    attributes = {"src": url(node["film"]), "aria-label": node["label"], "preload": "metadata"}
    if node["poster"]:
        attributes["poster"] = url(node["poster"])
    opening = translator.starttag(node, "video", "", autoplay="", loop="", muted="", playsinline="", **attributes)
    translator.body.append(f"{opening}</video>\n")
    raise nodes.SkipNode
