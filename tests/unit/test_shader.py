"""Includes, line maps, preprocessing and the interface check, all without OpenGL."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from pathlib import Path

import pytest

from gl import interface
from gl.executor import SHADER_ROOT
from gl.graph import ComputePass, FragmentPass, Graph, In, Out, Pass, Prev, Uniform
from gl.plan import Node
from gl.preprocessor import evaluate, preprocess
from gl.shader import ShaderError, Source, expand, strip_comments

Write = Callable[[str, str], None]


@pytest.fixture
def write(tmp_path: Path) -> Write:
    """Write a shader file below ``tmp_path``."""

    def write_file(path: str, text: str) -> None:
        (tmp_path / path).parent.mkdir(parents=True, exist_ok=True)
        (tmp_path / path).write_text(text)

    return write_file


# -------------------------------------------------------------------------------------------------------- expanding


def test_version_and_defines_go_in_front(tmp_path: Path, write: Write) -> None:
    write("a.frag", "void main() {}\n")
    source = expand(tmp_path, "a.frag", {"RADIUS": "2", "HAS_X": "0"})
    assert source.text == "#version 430 core\n#define RADIUS 2\n#define HAS_X 0\nvoid main() {}\n"
    assert source.where(4) == "a.frag:1"
    assert source.where(2) == "a.frag (line added in front: #define RADIUS 2)"
    assert source.where(99) == "a.frag"


def test_includes_nest_and_are_pasted_once(tmp_path: Path, write: Write) -> None:
    write("a.frag", '#include "common/b.glsl"\nmain\n  #  include "common/c.glsl" // again\nend\n')
    write("common/b.glsl", 'b1\n#include "common/c.glsl"\nb3\n')
    write("common/c.glsl", '#include "common/b.glsl"\nc2')
    source = expand(tmp_path, "a.frag")
    assert source.text.split("\n")[1:-1] == ["b1", "c2", "b3", "main", "end"]
    assert [source.where(line) for line in range(2, 7)] == [
        "common/b.glsl:1",
        "common/c.glsl:2",
        "common/b.glsl:3",
        "a.frag:2",
        "a.frag:4",
    ]
    assert source.files == ("a.frag", "common/b.glsl", "common/c.glsl")


def test_includes_in_comments_are_not_followed(tmp_path: Path, write: Write) -> None:
    text = '// #include "no.glsl"\n/* text\n#include "no.glsl"\n*/ done\n/* x */ #include "yes.glsl"\n'
    write("a.frag", text)
    write("yes.glsl", "yes // it's \f fine\n")
    assert expand(tmp_path, "a.frag").text.split("\n")[1:-1] == [*text.split("\n")[:4], "yes // it's \f fine"]


def test_strip_comments_keeps_places() -> None:
    assert strip_comments('a//b\n/*c\nd*/e "//f"') == 'a   \n   \n   e "//f"'


def test_include_mistakes_name_their_line(tmp_path: Path, write: Write) -> None:
    write("common/color.glsl", "float f;\n")
    write("a.frag", '\n#include "common/colour.glsl"\n')
    with pytest.raises(
        ShaderError, match=r"a\.frag:2: there is no shader file 'common/colour\.glsl'.*mean 'common/color\.glsl'"
    ):
        expand(tmp_path, "a.frag")
    with pytest.raises(ShaderError, match=r"there is no shader file 'b\.frag' below .*, did you mean 'a\.frag'\?"):
        expand(tmp_path, "b.frag")
    for text, message in {
        "#include <x>": r'a\.frag:1: expected #include "folder/file\.glsl", got #include <x>',
        '#if 1\n#include "common/color.glsl"\n#endif': r"a\.frag:2: #include inside #if",
        "#version 330": r"a\.frag:1: #version is not allowed",
        "\n#line 3": r"a\.frag:2: #line is not allowed",
    }.items():
        with pytest.raises(ShaderError, match=message):
            expand(tmp_path, "a.frag", text=text)
    (tmp_path / "a.frag").write_bytes(b"\xff\xfe")
    with pytest.raises(ShaderError, match=r"'a\.frag' cannot be read"):
        expand(tmp_path, "a.frag")


@pytest.mark.parametrize(
    ("log", "explained"),
    [
        ("0:3(7): error: `foo' undeclared", "common/b.glsl:1: error: `foo' undeclared\n    b = foo;"),
        ("0(3) : error C1503: undefined variable", "common/b.glsl:1: error C1503: undefined variable\n    b = foo;"),
        ("ERROR: 0:4: 'foo' : undeclared", "a.frag:2: error: 'foo' : undeclared\n    c = foo;"),
        ("0:99(1): error: end", "a.frag: error: end"),
        ("something else\n\n", "something else"),
    ],
    ids=["mesa", "nvidia", "amd", "outside", "free"],
)
def test_compile_logs_are_mapped_back(tmp_path: Path, write: Write, log: str, explained: str) -> None:
    write("a.frag", '#include "common/b.glsl"\nc = foo;\n')
    write("common/b.glsl", "  b = foo;\n")
    assert expand(tmp_path, "a.frag", {"A": "1"}).explain(log) == explained


# ---------------------------------------------------------------------------------------------------- preprocessing


@pytest.mark.parametrize(
    ("expression", "value"),
    [
        ("1 + 2 * 3", 7),
        ("(1 + 2) * 3", 9),
        ("10 - 4 - 3", 3),
        ("-7 / 2", -3),
        ("-7 % 3", -1),
        ("1 << 3 | 1", 9),
        ("0x1F & ~1u", 30),
        ("6 ^ 3", 5),
        ("! 0 == 1", 1),
        ("2 >= 2 && 3 != 3 || 1 < 2", 1),
        ("1 || 0 && 0", 1),
        ("N * 2", 3),  # N is 1 + 1, pasted as text: 1 + 1 * 2
        ("ALIAS", 2),
        ("defined N && defined(ALIAS) && !defined(M)", 1),
        ("defined(M) && M > 2", 0),
        ("!defined(M) || M > 2", 1),
    ],
)
def test_conditions(expression: str, value: int) -> None:
    assert evaluate(expression, {"N": "1 + 1", "ALIAS": "N"}) == value


@pytest.mark.parametrize(
    ("expression", "message"),
    [
        ("HAS_MSK", "'HAS_MSK' is not defined, did you mean 'HAS_MASK'"),
        ("1 / 0", "division by zero"),
        ("1 +", "ends too early"),
        ("(1", "ends too early"),
        ("(1 2)", "closing bracket is missing"),
        ("defined(A 1", "closing bracket is missing"),
        ("1 2", "did not expect '2'"),
        ("1.5 > 1", r"cannot read '\.5 > 1'"),
        ("", "ends too early"),
    ],
)
def test_bad_conditions(expression: str, message: str) -> None:
    with pytest.raises(ValueError, match=message):
        evaluate(expression, {"HAS_MASK": "0"})


def active(text: str, defines: Mapping[str, str] | None = None) -> list[str]:
    source = expand(Path(), "a.frag", defines, text=text)
    lines = preprocess(source).split("\n")
    assert len(lines) == len(source.text.split("\n"))
    return [line for line in lines if line]


def test_conditions_choose_lines() -> None:
    text = "#if A == 1\none\n#elif A == 2\ntwo\n#else\nother\n#endif\n"
    assert [active(text, {"A": a}) for a in "123"] == [["one"], ["two"], ["other"]]
    nested = "#ifdef A\n#ifndef B\na\n#else\nab\n#endif\n#elif 1\nnone\n#endif\n"
    assert active(nested) == ["none"]
    assert active(nested, {"A": ""}) == ["a"]
    assert active(nested, {"A": "", "B": ""}) == ["ab"]
    assert active("#if 0\n#if UNKNOWN\nx\n#elif ALSO\ny\n#else\nz\n#endif\n#error no\n#endif\nend") == ["end"]
    assert active("#if 1\na\n#elif UNKNOWN\nb\n#endif") == ["a"]


def test_macros_replace_words_outside_of_comments() -> None:
    text = (
        "#define SIZE 4 // four\n#define F(x) x\n#define TWICE (2 * \\\n SIZE)\nfloat a[SIZE]; // SIZE\nv.SIZE TWICE;\n"
    )
    assert [line.rstrip() for line in active(text)] == ["float a[4];", "v.SIZE (2 *  4);"]
    assert active("#define A 1\n#undef A\nA\n") == ["A"]


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("\n#if WHAT\n#endif", r"a\.frag:2: #if: 'WHAT' is not defined"),
        ("#endif", r"a\.frag:1: #endif without #if"),
        ("#if 1\n", "1 #endif missing"),
        ("#error stop here", r"a\.frag:1: #error stop here"),
        ("#define", r"a\.frag:1: #define : a name is expected"),
    ],
)
def test_preprocessing_mistakes_name_their_line(text: str, message: str) -> None:
    with pytest.raises(ShaderError, match=message):
        active(text)


# -------------------------------------------------------------------------------------------------- interface check


class Filter(FragmentPass):
    shader = "t/filter.frag"
    in_color = In("c")
    in_mask = In("m", optional=True)
    prev_color = Prev("h")
    out_color = Out("rgba16f", "c")
    out_moments = Out("rg32f", "m")
    u_alpha = Uniform("float", "a")
    u_size = Uniform("ivec2", "s")


class Count(ComputePass):
    shader = "t/count.comp"
    in_color = In("c")
    out_color = Out("rgba16f", "c")
    out_count = Out("r32ui", "n")


FILTER = """\
uniform sampler2D in_color, prev_color;
#if HAS_IN_MASK
uniform sampler2D in_mask;
#endif
uniform highp float u_alpha;
uniform ivec2 u_size; uniform bool u_history_valid;
layout(location = 0) out vec4 out_color;
layout (location=1)
out vec2 out_moments;
const float uniform_scale = sqrt(2.0);
struct Tap { vec2 offset; float weight; };
void filter_in(in vec3 a, out vec4 b, inout Tap c);
void filter_in(in vec3 a, out vec4 b, inout Tap c) { if (a.x > 0.) { b = vec4(0); } vec4 out_local; }
void main() { out_color = vec4(u_alpha); }
"""

COUNT = """\
layout(local_size_x = GROUP_X, local_size_y = GROUP_Y) in;
uniform sampler2D in_color;
layout(rgba16f, binding = 0) writeonly uniform image2D out_color;
layout(r32ui, binding = 1) uniform restrict writeonly uimage2D out_count;
shared float rows[GROUP_X][4];
void main() {}
"""


def node(work: Pass, mask: str = "", color: str = "rgba32f") -> Node:
    g = Graph()
    inputs = {"in_color": g.import_("color", color)} | ({"in_mask": g.import_("mask", mask)} if mask else {})
    histories = {"prev_color": g.history("h", "rgba16f")} if work.ports.prevs else {}
    added = g.add(work, **inputs, **histories)
    for history in histories.values():
        g.feed(history, added.out_color)
    g.output("display", added.out_color)
    return g.compile().passes[0]


def check(text: str, wanted: Node) -> None:
    interface.check(expand(Path(), wanted.work.shader, wanted.defines(), text=text), wanted)


def filter_node(mask: str = "") -> Node:
    return node(Filter(u_alpha=1.0, u_size=(1, 1)), mask)


def test_matching_interfaces_pass() -> None:
    check(FILTER, filter_node())
    check(FILTER, filter_node("r8"))
    check(FILTER.replace("uniform sampler2D in_mask", "uniform usampler2D in_mask"), filter_node("r32ui"))
    check(FILTER.replace("vec2 out_moments", "vec4 out_moments"), filter_node())
    check(COUNT, node(Count()))
    check(COUNT.replace("rgba16f", "FORMAT"), node(Count(formats={"out_color": "r8"}, defines={"FORMAT": "r8"})))


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        ("u_alpha;", "u_alhpa;", r"filter\.frag:5: 'u_alhpa' is no port of Filter, did you mean 'u_alpha'\?"),
        ("u_alpha;", "u_alhpa;", r"'uniform float u_alpha;' is missing for Filter\.u_alpha, did you mean 'u_alhpa'\?"),
        ("highp float", "int", r"filter\.frag:5: 'u_alpha' does not match Filter, write 'uniform float u_alpha;'"),
        ("u_alpha;", "u_alpha[2];", r"write 'uniform float u_alpha;'"),
        ("u_alpha;", "u_alpha = sqrt(1.0);", r"filter\.frag:5: 'u_alpha' has an initialiser"),
        (
            "sampler2D in_color",
            "usampler2D in_color",
            r"filter\.frag:1: 'in_color' does not match .* 'uniform sampler2D in_color;'",
        ),
        (", prev_color", "", r"'uniform sampler2D prev_color;' is missing for Filter\.prev_color"),
        (" uniform bool u_history_valid;", "", r"'uniform bool u_history_valid;' is missing"),
        ("bool u_history", "int u_history", r"write 'uniform bool u_history_valid;'"),
        ("#if HAS_IN_MASK", "#if 1", r"filter\.frag:3: optional input 'in_mask' is not connected; .* #if HAS_IN_MASK"),
        ("#if HAS_IN_MASK", "#if HAS_MASK", r"'HAS_MASK' is not defined, did you mean 'HAS_IN_MASK'"),
        (
            "location = 0",
            "location = 1",
            r"filter\.frag:7: 'out_color' .* 'layout\(location = 0\) out vec4 out_color;'",
        ),
        ("vec2 out_moments", "float out_moments", r"filter\.frag:8: 'out_moments' does not match Filter"),
        ("vec2 out_moments", "uvec2 out_moments", "'out_moments' does not match Filter"),
        ("out vec4 out_color;", "out vec4 out_colour;", r"'out_colour' is no port of Filter, did you mean 'out_color'"),
        ("const float", "in vec2 uv; const float", r"filter\.frag:10: in 'uv': ports are plain uniforms"),
        (
            "const float",
            "uniform Block { vec4 a; } block; const float",
            r"filter\.frag:10: uniform 'Block': ports are plain",
        ),
        ("const float", "buffer Data { vec4 a[]; }; const float", "buffer 'Data': ports are plain"),
        ("const float", "shared float a; const float", "shared 'a': ports are plain"),
        ("const float", "uniform image2D u_image; const float", "'u_image' is no port of Filter"),
    ],
)
def test_differing_fragment_interfaces(old: str, new: str, message: str) -> None:
    assert old in FILTER
    with pytest.raises(ShaderError, match=message):
        check(FILTER.replace(old, new), filter_node())


@pytest.mark.parametrize(
    ("old", "new"),
    [
        ("rgba16f", "rgba32f"),
        ("rgba16f, ", ""),
        ("binding = 1", "binding = 0"),
        (", binding = 0", ""),
        ("writeonly uniform image2D", "uniform image2D"),
        ("uimage2D", "image2D"),
    ],
)
def test_differing_images(old: str, new: str) -> None:
    assert old in COUNT
    with pytest.raises(
        ShaderError, match=r"write 'layout\((rgba16f|r32ui), binding = [01]\) writeonly uniform u?image2D out_"
    ):
        check(COUNT.replace(old, new), node(Count()))


def test_a_shader_without_histories_does_not_ask_for_their_flag() -> None:
    with pytest.raises(ShaderError, match="'u_history_valid' is no port of Count"):
        check(COUNT + "uniform bool u_history_valid;\n", node(Count()))


def test_integer_inputs_want_integer_samplers() -> None:
    with pytest.raises(ShaderError, match=r"write 'uniform usampler2D in_color;'"):
        check(COUNT, node(Count(), color="r32ui"))


def test_all_differences_are_reported_at_once() -> None:
    text = FILTER.replace("u_alpha;", "u_a;").replace("location = 0", "location = 3")
    with pytest.raises(ShaderError) as caught:
        check(text, filter_node())
    assert len(str(caught.value).splitlines()) == 3


def test_common_files_have_pure_functions_only(tmp_path: Path, write: Write) -> None:
    write("common/pure.glsl", "float twice(in float x) { return 2.0 * x; }\nconst float PI = 3.14;\n")
    write("t/count.comp", '#include "common/pure.glsl"\n' + COUNT)
    assert isinstance(interface.load(tmp_path, node(Count())), Source)
    write("common/pure.glsl", "\nuniform float u_gamma;\n")
    with pytest.raises(
        ShaderError, match=r"common/pure\.glsl:2: uniform 'u_gamma': files in common/ have pure functions"
    ):
        interface.load(tmp_path, node(Count()))


@pytest.mark.parametrize("path", sorted(p.relative_to(SHADER_ROOT).as_posix() for p in SHADER_ROOT.glob("common/*.*")))
def test_our_common_files_are_pure(path: str) -> None:
    assert interface.declarations(expand(SHADER_ROOT, path)) == []
