"""Where a scene's files may lie, how much of them is read, and long lists of numbers."""

from __future__ import annotations

import gzip
import os
import time
from pathlib import Path

import numpy as np
import pytest

from scenes import files, load
from scenes.description.shapes import Sphere, TriangleMesh
from scenes.errors import SceneError
from scenes.pbrt.parser import parse, parse_file
from scenes.pbrt.text import stream
from scenes.pbrt.text.lexer import Source
from scenes.pbrt.text.numbers import SHORT, read_run
from tests.kit.scene_texts import HEAD, fails, world

BALL = 'Shape "sphere"'


def scene_in(folder: Path, body: str) -> Path:
    (folder / "inner").mkdir(exist_ok=True)
    path = folder / "inner" / "s.pbrt"
    path.write_text(HEAD + body)
    return path


def test_files_outside_the_scene_s_folder_must_be_allowed(tmp_path: Path) -> None:
    outside = tmp_path / "part.pbrt"
    outside.write_text(BALL)
    for name in ("../part.pbrt", str(outside), "../inner/../part.pbrt"):
        path = scene_in(tmp_path, f'Include "{name}"')
        with pytest.raises(
            SceneError, match=r"s\.pbrt:7:1: .*lies outside the folder of the scene.*--allow-outside"
        ):
            parse_file(path)
        assert len(parse_file(path, allow_outside=True).shapes) == 1
        assert len(load(str(path), allow_outside=True).shapes) == 1
    path = scene_in(tmp_path, 'Include "../inner/own.pbrt"')
    (tmp_path / "inner" / "own.pbrt").write_text(BALL)
    assert len(parse_file(path).shapes) == 1


@pytest.mark.parametrize(
    "line",
    [
        'Import "../x"',
        'Shape "plymesh" "string filename" "../x.ply"',
        'LightSource "infinite" "string filename" "../x.exr"',
        'LightSource "distant" "spectrum L" "../x.spd"',
        'AreaLightSource "diffuse" "string filename" "/etc/passwd"',
        'Texture "t" "spectrum" "imagemap" "string filename" "../../x.png"',
    ],
)
def test_every_way_to_name_a_file_is_kept_inside(tmp_path: Path, line: str) -> None:
    with pytest.raises(SceneError, match="lies outside the folder"):
        parse_file(scene_in(tmp_path, line))


def test_a_link_that_leads_outside_is_outside(tmp_path: Path) -> None:
    (tmp_path / "part.pbrt").write_text(BALL)
    path = scene_in(tmp_path, 'Include "link.pbrt"')
    (tmp_path / "inner" / "link.pbrt").symlink_to(tmp_path / "part.pbrt")
    with pytest.raises(SceneError, match="lies outside the folder"):
        parse_file(path)


def test_names_are_relative_to_the_top_file_first_as_in_pbrt(tmp_path: Path) -> None:
    (tmp_path / "sub").mkdir()
    (tmp_path / "top.pbrt").write_text(HEAD + 'Include "sub/a.pbrt"')
    (tmp_path / "sub" / "a.pbrt").write_text('Include "ball.pbrt"')
    (tmp_path / "sub" / "ball.pbrt").write_text('Shape "sphere" "float radius" 2')
    assert radius_of(tmp_path / "top.pbrt") == 2
    (tmp_path / "ball.pbrt").write_text('Shape "sphere" "float radius" 1')
    assert radius_of(tmp_path / "top.pbrt") == 1


def radius_of(path: Path) -> float:
    (shape,) = parse_file(path).shapes
    assert isinstance(shape.geometry, Sphere)
    return shape.geometry.radius


def test_included_files_are_bounded_together(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(stream, "FILE_LIMIT", 1000)
    (tmp_path / "s.pbrt").write_text(HEAD + 'Include "a.pbrt"\n' * 3)
    (tmp_path / "a.pbrt").write_text(" " * 400)
    with pytest.raises(SceneError, match=r"s\.pbrt:9:1: the included files are larger than"):
        parse_file(tmp_path / "s.pbrt")


def test_what_is_no_regular_file_is_not_waited_for(tmp_path: Path) -> None:
    os.mkfifo(tmp_path / "pipe.pbrt")
    with pytest.raises(SceneError, match="no regular file"):
        parse_file(tmp_path / "pipe.pbrt")
    with pytest.raises(SceneError, match="a folder"):
        parse_file(tmp_path)


def test_files_are_read_up_to_a_limit(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(files, "FILE_LIMIT", 1000)
    (tmp_path / "s.pbrt").write_text(HEAD + " " * 1000)
    with pytest.raises(SceneError, match="larger than 0 MiB"):
        parse_file(tmp_path / "s.pbrt")
    (tmp_path / "s.pbrt").write_text(HEAD + 'Include "a.pbrt.gz"')
    (tmp_path / "a.pbrt.gz").write_bytes(
        gzip.compress(b" " * 10**7)
    )  # a small file that would fill the memory
    with pytest.raises(SceneError, match=r"s\.pbrt:7:1: .*larger than"):
        parse_file(tmp_path / "s.pbrt")
    (tmp_path / "a.pbrt.gz").write_bytes(gzip.compress(BALL.encode()))
    assert len(parse_file(tmp_path / "s.pbrt").shapes) == 1


def run_of(text: str) -> tuple[list[float], str] | None:
    """The run at the beginning of `text`, and what is left behind it."""
    run = read_run(Source("f", text), 0)
    return None if run is None else (run.array.tolist(), text[run.end :])


def test_numbers_in_one_go_are_to_the_bit_what_they_are_one_by_one() -> None:
    rng = np.random.default_rng(11)
    values = rng.normal(size=20_000) * 10.0 ** rng.integers(-300, 300, 20_000)
    words = [repr(v) for v in values.tolist()]
    words += [f"{v:.25e}" for v in values[:2000]] + [f"{v % 1e3:.6f}" for v in values[:2000]]
    assert run_of(" ".join(words) + "]") == ([float(word) for word in words], "]")


PAD = " " * SHORT


@pytest.mark.parametrize(
    ("text", "values", "rest"),
    [
        ("1 2\r\n3\t-4.e1 +.5 -0]", [1, 2, 3, -40, 0.5, 0], "]"),
        ("1 # one ] 2\n3]", [1, 3], "]"),
        ("#\n1]", [1], "]"),
        ("1 #$ late 1\n 2]", [1], "#$ late 1\n 2]"),
        ("1 1#2\n]", [1], "1#2\n]"),
        ("1 2", [1], "2"),  # perhaps half a word
        ("1 2-3]", [1], "2-3]"),
        ("1 1.2.3]", [1], "1.2.3]"),
        ("1 1e]", [1], "1e]"),
        ("1 - 1]", [1], "- 1]"),
        ("1 .]", [1], ".]"),
        ("1 nan]", [1], "nan]"),
        ("1 0x3]", [1], "0x3]"),
        ("1 1_0]", [1], "1_0]"),
        ("1 $x]", [1], "$x]"),
        ('1 "1"]', [1], '"1"]'),
        ("1 [ 2 ]]", [1], "[ 2 ]]"),
        ("1 ٣]", [1], "٣]"),
    ],
)
def test_runs_of_numbers(text: str, values: list[float], rest: str) -> None:
    assert run_of(PAD + text) == (values, rest)


@pytest.mark.parametrize(
    "text", ["1 2 ]", "1 2 3 x", PAD + "]", PAD + "x", PAD + "# comment\n]", "x" * 100, "", PAD]
)
def test_what_is_short_or_empty_is_no_run(text: str) -> None:
    assert run_of(text) is None


def test_a_whole_list_of_several_numbers_is_a_run() -> None:
    assert run_of("1 2 3 ]") == ([1, 2, 3], "]")


def test_a_run_may_begin_with_a_long_word_or_comment() -> None:
    assert run_of("1." + "0" * 100 + " 2 3]") == ([1, 2, 3], "]")
    assert run_of(" # " + "x" * 100 + "\n 1 2 3]") == ([1, 2, 3], "]")


@pytest.mark.parametrize("word", ["x", "1e999", "1-2", "1.2.3", "$gone", "1_0", '"3"'])
@pytest.mark.parametrize("comment", ["", "# comment ]\n"])
def test_an_error_far_inside_a_list_is_found_at_its_place(word: str, comment: str) -> None:
    start = f'Shape "trianglemesh" "point3 P" [\n{comment}' + "0 0 0\n" * 1000
    lines = HEAD.count("\n") + start.count("\n") + 1
    fails(f"{HEAD}{start}1 {word} 2 ]", lines, 3, word.strip('"'))


def test_indices_far_inside_a_list_are_checked_at_their_place() -> None:
    points = "0 0 0  1 0 0  0 1 0\n" * 10
    for word, message in (
        ("30", "out of range"),
        ("1.5", "whole number"),
        ("99999999999", "whole number"),
        ("1e0", "whole number"),
    ):
        body = (
            f'Shape "trianglemesh" "point3 P" [ {points} ] "integer indices" [\n'
            + "0 1 2\n" * 100
            + f"0 {word} 2 ]"
        )
        fails(HEAD + body, HEAD.count("\n") + 10 + 102, 3, message)


def test_templates_reach_into_long_lists() -> None:
    text = (
        '#$ x 7 "units"\n' + HEAD + 'Shape "trianglemesh" "point3 P" [ ' + "0 0 0 " * 50 + "$x 0 0 0 1 0 ] "
    )
    geometry = parse(text + '"integer indices" [ 0 50 51 ]').shapes[0].geometry
    assert isinstance(geometry, TriangleMesh)
    assert geometry.vertices[50].tolist() == [7, 0, 0]


def test_characters_beyond_ascii_count_as_one() -> None:
    fails("# häßlich 𝛼\nWorldBegin # 𝛼\n 𝛼", 3, 2, "𝛼")
    assert world('Shape "sphere" # 𝛼').shapes


@pytest.mark.slow
def test_speed_on_a_hundred_megabytes(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """At least 5 MB/s, so that 100 MB take 20 s at most; some 25 MB/s where this was written."""
    rng = np.random.default_rng(1)
    count = 1_600_000
    points = "\n".join(f"{x:.6f} {y:.6f} {z:.6f}" for x, y, z in rng.normal(size=(count, 3)).tolist())
    faces = "\n".join(f"{a} {b} {c}" for a, b, c in rng.integers(0, count, (2 * count, 3)).tolist())
    path = tmp_path / "s.pbrt"
    path.write_text(
        f'{HEAD}Shape "trianglemesh" "point3 P" [\n{points}\n]\n"integer indices" [\n{faces}\n]\n'
    )
    start = time.process_time()
    (shape,) = parse_file(path).shapes
    speed = path.stat().st_size / 1e6 / (time.process_time() - start)
    with capsys.disabled():
        print(f"\n{path.stat().st_size / 1e6:.0f} MB of numbers read at {speed:.1f} MB/s")
    assert isinstance(shape.geometry, TriangleMesh)
    assert speed > 5
