"""docs/scenes.md says what the code reads."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import pytest

from scenes.errors import SceneError
from scenes.pbrt.directives.integrator import TRANSPORT
from scenes.pbrt.kinds import PBRT, Kinds, kinds, table
from scenes.pbrt.parameter_tables import parameter_table, stand_in_table
from scenes.pbrt.parser import parse
from tests.kit.scene_texts import HEAD

PAGE = Path(__file__).parents[2] / "docs" / "scenes.md"


def test_the_page_holds_the_table_of_the_code() -> None:
    assert table() in PAGE.read_text(encoding="utf-8"), (
        "docs/scenes.md is stale: `python -m scenes.pbrt.kinds` prints its table"
    )


@pytest.mark.parametrize("made", [parameter_table, stand_in_table])
def test_the_page_holds_the_tables_of_the_readers(made: Callable[[], str]) -> None:
    assert made() in PAGE.read_text(encoding="utf-8"), (
        "docs/scenes.md is stale: `python -m scenes.pbrt.parameter_tables` prints its tables"
    )


def test_the_readers_tell_what_they_ask_for() -> None:
    """A reader that stopped at once, for want of what it needs, would leave an empty row."""
    rows = dict(line.strip("| ").split(" | ") for line in parameter_table().splitlines()[2:])
    assert rows['`Shape "plymesh"`'].startswith("`filename`, ")
    assert "`roughness` (or a texture)" in rows['`Material "coateddiffuse"`']
    assert rows['`Shape "sphere"`'] == "`radius`, `zmin`, `zmax`, `phimax`, `alpha` (or a texture)"
    silent = {kind for kind, found in rows.items() if found == "none that has an effect"}
    assert silent == {
        *(f'`Integrator "{kind}"`' for kind in TRANSPORT if f'`Integrator "{kind}"`' in rows),
        '`Integrator "simplevolpath"`', '`Integrator "randomwalk"`', '`Material "interface"`',
        '`PixelFilter "mitchell"`', '`PixelFilter "sinc"`', '`Texture "windy"`', '`Texture "ptex"`',
    }  # fmt: skip


def test_every_kind_of_pbrt_is_in_the_table_once() -> None:
    for row in kinds():
        named = [*row.rendered, *row.substituted, *row.refused]
        assert sorted(named) == sorted(PBRT[row.directive].split())


def test_what_is_no_kind_of_pbrt_v4_is_known_here() -> None:
    """pbrt-v3's integrator, of which public files are left."""
    assert {row.directive: row.other for row in kinds() if row.other} == {"Integrator": ("directlighting",)}


@pytest.mark.parametrize("row", list(kinds()), ids=lambda row: row.directive)
def test_what_is_refused_is_refused_by_the_parser(row: Kinds) -> None:
    for kind in row.refused:
        first = f'"name" "spectrum" "{kind}"' if row.directive == "Texture" else f'"{kind}"'
        text = f"{row.directive} {first}\n"
        world = row.directive in ("Shape", "LightSource", "AreaLightSource", "Material", "Texture")
        with pytest.raises(SceneError, match=f"{row.directive}|shape"):
            parse(f"{HEAD}{text}" if world else f"{HEAD.replace('WorldBegin', text + 'WorldBegin')}")
