"""The self-contained pages: templates, inline figures, inline style."""
import base64
import io
import re
from pathlib import Path

import jinja2

from ..draw.style import plt


def address(svg):
    return "data:image/svg+xml;base64," + base64.b64encode(svg).decode()


def inline_svg(figure):
    """The figure as a data address of SVG."""
    out = io.BytesIO()
    figure.savefig(out, format="svg", dpi=220, metadata={"Date": None, "Creator": None})
    return address(out.getvalue())


_NAMED = re.compile(r' id="(?!series:)([^"]*)"')
_SERIES = re.compile(r""" id=(["'])series:(.*?)\1""")


def both_svgs(figure, name):
    """(data address, element of the page) of a figure, from one rendering: in the element series carry their names, and what it refers to by
    an id is its own."""
    out = io.BytesIO()
    with plt.rc_context({"svg.hashsalt": name}):
        figure.savefig(out, format="svg", dpi=220, metadata={"Date": None, "Creator": None})
    image, text = address(out.getvalue()), out.getvalue().decode()
    text = text[text.index("<svg"):]
    asked = set(re.findall(r'href="#([^"]*)"|url\(#([^)]*)\)', text))
    asked = {name for pair in asked for name in pair if name}
    text = _NAMED.sub(lambda m: m[0] if m[1] in asked else "", text)  # of groups that nothing refers to

    def named(match):
        label = match[2].replace('"', "&quot;")
        return f' data-series="series:{label}" data-label="{label}"'
    return image, _SERIES.sub(named, text)


def scripts():
    """The library and what the page does with it, as text."""
    return [Path(__file__).with_name(name).read_text(encoding="utf-8") for name in ("d3.min.js", "interactive.js")]


def render(template, autoescape=True, **content):
    """A page as text."""
    environment = jinja2.Environment(loader=jinja2.FileSystemLoader(Path(__file__).parent), autoescape=autoescape,
                                     trim_blocks=True, lstrip_blocks=True, undefined=jinja2.StrictUndefined)
    return environment.get_template(template).render(**content)
