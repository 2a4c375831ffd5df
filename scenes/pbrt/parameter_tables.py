"""The parameters that are read of each kind, and the parts that have a stand-in, as the readers tell them.

`python -m scenes.pbrt.parameter_tables` prints them as the further tables of docs/scenes.md. Each kind is
read once, with the least that it needs, and tells what its reader asked for. The stand-ins are what the
readers' sources report as such.
"""

from __future__ import annotations

import ast
from contextlib import suppress
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np

from scenes.errors import PenumbraError, Report
from scenes.files import Files
from scenes.images.exr import write_exr
from scenes.pbrt.directives.table import OPTIONS, WORLD
from scenes.pbrt.directives.textures import texture
from scenes.pbrt.kinds import kinds
from scenes.pbrt.state import Builder
from scenes.pbrt.text.lexer import Source
from scenes.pbrt.text.parameters import SRGB, Parameters
from scenes.pbrt.text.stream import TokenStream
from scenes.pbrt.text.syntax import Syntax
from scenes.pbrt.text.template import Bindings, read_header
from scenes.pbrt.transforms import identity

CORNERS = '"point3 P" [ 0 0 0  1 0 0  0 1 0 '
IMAGE = '"string filename" "image.exr"'
# What kinds need.
NEEDED = {
    "Shape trianglemesh": f"{CORNERS}]",
    "Shape loopsubdiv": f'{CORNERS}] "integer indices" [ 0 1 2 ]',
    "Shape bilinearmesh": f"{CORNERS} 1 1 0 ]",
    "Shape curve": f"{CORNERS} 1 1 0 ]",
    "Shape plymesh": '"string filename" "mesh.ply"',
    "LightSource projection": IMAGE,
    "LightSource goniometric": IMAGE,
    "Texture imagemap": IMAGE,
    "Material mix": '"string materials" [ "a" "b" ]',
}
PLY = "\n".join(
    [
        "ply\nformat ascii 1.0\nelement vertex 3",
        *(f"property float {axis}" for axis in "xyz"),
        "element face 1\nproperty list uchar int vertex_indices\nend_header",
        "0 0 0\n1 0 0\n0 1 0\n3 0 1 2\n",
    ]
)


def parameter_table() -> str:
    """The parameters of each kind as Markdown."""
    lines = ["| kind | parameters |", "| --- | --- |"]
    with TemporaryDirectory() as folder:
        write_exr(Path(folder) / "image.exr", {name: np.ones((2, 2)) for name in "RGB"})
        (Path(folder) / "mesh.ply").write_text(PLY)
        for row in kinds():
            if row.directive in OPTIONS or row.directive in WORLD or row.directive == "Texture":
                for kind in (*row.rendered, *row.substituted):
                    found = _parameters(row.directive, kind, Path(folder))
                    lines.append(f'| `{row.directive} "{kind}"` | {found} |')
    return "\n".join(lines) + "\n"


def _parameters(directive: str, kind: str, folder: Path) -> str:
    """Those of one kind, in the order that the reader asks for them."""
    found: dict[str, set[str]] = {}
    for type_ in ("float", "spectrum") if directive == "Texture" else ("",):
        for types, name in _read(directive, kind, type_, folder).supported:
            found.setdefault(name, set()).update(types)
    shown = [f"`{name}`{' (or a texture)' * ('texture' in types)}" for name, types in found.items()]
    return ", ".join(shown) or "none that has an effect"


def _read(directive: str, kind: str, type_: str, folder: Path) -> Parameters:
    """The parameters of the smallest directive of a kind, once its reader is through or has had enough."""
    source = Source("table", f"{directive} {NEEDED.get(f'{directive} {kind}', '')}")
    report = Report(substitute=True)
    tokens = TokenStream(source, 0, Files(folder))
    syntax = Syntax(tokens, Bindings(read_header(source), {}), report, lambda: SRGB)
    owner = tokens.next()
    assert owner is not None
    parameters, builder = syntax.parameters(owner), Builder(report=report)
    # Where a kind is of the other type of texture, or wants more: what it asked for until then counts.
    with suppress(PenumbraError):
        if directive == "Texture":
            texture(builder, "t", type_, kind, parameters, identity())
        else:
            handler = OPTIONS[directive] if directive in OPTIONS else WORLD[directive][0]
            handler(builder, kind, parameters)
    return parameters


def stand_in_table() -> str:
    """Stand-ins as Markdown, read from the readers' own sources; … for what they put in."""
    lines = ["| part | rendered by `--substitute` |", "| --- | --- |"]
    for path in sorted(Path(__file__).parent.rglob("*.py")):
        for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
            if not (isinstance(node, ast.Call) and isinstance(node.func, ast.Attribute)):
                continue
            owner = ast.unparse(node.func.value).split(".")[-1]
            if node.func.attr == "substitute" and owner in ("parameters", "report"):
                what, nearest = node.args[1:3] if owner == "parameters" else node.args[:2]
                lines.append(f"| {_said(what)} | {_said(nearest)} |")
    return "\n".join(dict.fromkeys(lines)) + "\n"


def _said(node: ast.expr) -> str:
    """The words of a message."""
    if isinstance(node, ast.JoinedStr):
        return "".join(str(part.value) if isinstance(part, ast.Constant) else "…" for part in node.values)
    return str(ast.literal_eval(node))


if __name__ == "__main__":
    print(parameter_table(), stand_in_table(), sep="\n", end="")
