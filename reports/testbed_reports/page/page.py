"""The self-contained pages: templates, inline figures, inline style."""
import base64
import io
from pathlib import Path

import jinja2


def inline_svg(figure):
    """The figure as a data address of SVG."""
    out = io.BytesIO()
    figure.savefig(out, format="svg", dpi=220, metadata={"Date": None, "Creator": None})
    return "data:image/svg+xml;base64," + base64.b64encode(out.getvalue()).decode()


def render(template, autoescape=True, **content):
    """A page as text."""
    environment = jinja2.Environment(loader=jinja2.FileSystemLoader(Path(__file__).parent), autoescape=autoescape,
                                     trim_blocks=True, lstrip_blocks=True, undefined=jinja2.StrictUndefined)
    return environment.get_template(template).render(**content)
