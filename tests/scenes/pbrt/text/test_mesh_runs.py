"""Many plain triangle meshes in a row: the same triangles as read one by one, and the same errors."""

import numpy as np
import pytest

from scenes import SceneDescription, SceneError
from scenes.pbrt.parser import parse
from scenes.pbrt.text import mesh_runs

HEAD = 'Camera "perspective"\nFilm "rgb" "string filename" "a.exr"\nIntegrator "path"\nWorldBegin\n'
COUNT = 100


def quads(count: int = COUNT, changed: dict[int, str] | None = None) -> str:
    """Quads along x, one a line from the fifth line on; changed: other text of some of them."""
    lines = [
        f'Shape "trianglemesh" "integer indices" [ 0 1 2 0 2 3 ] '
        f'"point3 P" [ {i} 0 1e1 {i}.5 0 10 {i}.5 .5 10 {i} .5 +10 ]'
        for i in range(count)
    ]
    for i, text in (changed or {}).items():
        lines[i] = text
    return "\n".join(lines)


def corners(scene: SceneDescription) -> np.ndarray:
    """(t, 3, 3) of all triangles, in their order."""
    meshes = [shape.geometry.triangulated() for shape in scene.shapes]
    return np.concatenate([mesh.vertices[mesh.faces] for mesh in meshes])


@pytest.mark.parametrize("state", ["", "Translate 1 2 3 Scale 2 -1 1", "ReverseOrientation"])
def test_a_run_holds_the_triangles_that_its_directives_hold(
    state: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    text = f"{HEAD}{state}\n{quads()}\nAttributeBegin\nAttributeEnd\n"
    together = parse(text)
    monkeypatch.setattr(mesh_runs, "FEW", COUNT + 1)
    apart = parse(text)
    assert (len(together.shapes), len(apart.shapes)) == (1, COUNT)
    assert np.array_equal(corners(together), corners(apart))
    assert {s.geometry.reverse for s in apart.shapes} == {together.shapes[0].geometry.reverse}
    assert together.shapes[0].where == apart.shapes[0].where


def test_a_run_ends_at_a_mesh_with_more_to_say_at_a_comment_and_at_another_directive() -> None:
    uv = (
        'Shape "trianglemesh" "integer indices" [ 0 1 2 ] "point3 P" [ 0 0 1 1 0 1 0 1 1 ] '
        '"point2 uv" [ 0 0 1 0 0 1 ]'
    )
    lines = {33: uv, 66: 'Shape "sphere"'}
    scene = parse(f"{HEAD}{quads(changed=lines)}\n# the end\n")
    kinds = [type(shape.geometry).__name__ for shape in scene.shapes]
    # The last quad of a run stands before what ends it; the last of all before a comment.
    assert kinds[:4] == ["TriangleMesh", "TriangleMesh", "TriangleMesh", "Sphere"]
    assert len(corners(parse(f"{HEAD}{quads(changed={33: uv})}\n"))) == 2 * (COUNT - 1) + 1


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ('"integer indices" [ 0 1 9 ] "point3 P" [ 0 0 1 1 0 1 0 1 1 ]', "index 9 is out of range"),
        ('"integer indices" [ 0 1 ] "point3 P" [ 0 0 1 1 0 1 0 1 1 ]', "groups of 3"),
        ('"integer indices" [ 0 1 2 ] "point3 P" [ 0 0 1 1 0 1 0 1 ]', "groups of 3"),
        ('"integer indices" [ 0 1 2 ] "point3 P" [ 0 0 1 1 0 1 0 1 1e999 ]', "beyond the range"),
        ('"integer indices" [ 0 1 2 ] "point3 P" [ 0 0 1 1 0 1 0 1 1.2.3 ]', "not a number"),
    ],
)
def test_an_error_within_a_run_is_told_at_its_line(text: str, message: str) -> None:
    bad = f'Shape "trianglemesh" {text}'
    with pytest.raises(SceneError, match=message) as caught:
        parse(HEAD + quads(changed={70: bad}) + "\nAttributeBegin\nAttributeEnd\n")
    assert ":75:" in str(caught.value)


def test_a_malformed_mesh_costs_one_scan_of_its_run(monkeypatch: pytest.MonkeyPatch) -> None:
    scans: list[int] = []
    joined = mesh_runs._joined

    def counted(points: list[str], indices: list[str]) -> mesh_runs.MeshRun | None:
        scans.append(len(points))
        return joined(points, indices)

    monkeypatch.setattr(mesh_runs, "_joined", counted)
    bad = 'Shape "trianglemesh" "integer indices" [ 0 1 9 ] "point3 P" [ 0 0 1 1 0 1 0 1 1 ]'
    with pytest.raises(SceneError):
        parse(HEAD + quads(changed={70: bad}) + "\nAttributeBegin\nAttributeEnd\n")
    assert scans == [COUNT]


def test_meshes_that_emit_or_take_an_attribute_stay_shapes_of_their_own() -> None:
    light = 'AttributeBegin\nAreaLightSource "diffuse"\n'
    assert len(parse(f"{HEAD}{light}{quads()}\nAttributeEnd\n").shapes) == COUNT
    attribute = 'Attribute "shape" "bool alone" true\n'
    assert len(parse(f"{HEAD}{attribute}{quads()}\nAttributeBegin\nAttributeEnd\n").shapes) == COUNT
