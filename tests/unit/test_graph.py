"""The render graph without OpenGL: declaring passes and wiring them."""

from __future__ import annotations

import subprocess
import sys

import pytest

from gl.graph import FragmentPass, Graph, GraphError, In, Out, Outputs, Prev, Uniform
from tests.unit.small_graphs import COLOR, Blur, Show, Source, Temporal, Tiles, blur

# ------------------------------------------------------------------------------------------------ declaring passes


@pytest.mark.parametrize(
    ("attribute", "port", "message"),
    [
        ("color", In("c"), r"Bad\.color is In: its name must start with 'in_'"),
        ("in_color", Prev("c"), r"Bad\.in_color is Prev: its name must start with 'prev_'"),
        ("prev_color", Out(COLOR, "c"), r"must start with 'out_'"),
        ("out_alpha", Uniform("float", "a"), r"must start with 'u_'"),
        ("u_alpha", 0.5, r"Bad\.u_alpha must be Uniform\(\.\.\.\), got 0\.5"),
        ("u_history_valid", Uniform("bool", "v"), r"the executor sets it"),
    ],
)
def test_port_names_are_enforced_when_the_class_is_created(attribute: str, port: object, message: str) -> None:
    with pytest.raises(GraphError, match=message):
        type("Bad", (FragmentPass,), {attribute: port})


def test_declarations_are_checked_when_the_class_is_created() -> None:
    out = Out(COLOR, "c")
    with pytest.raises(GraphError, match=r"Bad\.shader is 'a\.comp', must end with '\.frag'"):
        type("Bad", (FragmentPass,), {"shader": "a.comp", "out_color": out})
    with pytest.raises(GraphError, match="writes nothing"):
        type("Bad", (FragmentPass,), {"shader": "a.frag"})
    with pytest.raises(GraphError, match="one divisor"):
        type("Bad", (FragmentPass,), {"shader": "a.frag", "out_a": out, "out_b": Out(COLOR, "c", divisor=2)})
    with pytest.raises(GraphError, match="9 outputs"):
        type("Bad", (FragmentPass,), {"shader": "a.frag"} | {f"out_{i}": out for i in range(9)})
    with pytest.raises(GraphError, match="17 inputs"):
        type("Bad", (FragmentPass,), {"shader": "a.frag", "out_a": out} | {f"in_{i}": In("c") for i in range(17)})
    with pytest.raises(ValueError, match="unknown texture format"):
        Out("rgba17f", "c")
    with pytest.raises(ValueError, match="divisor is 0"):
        Out(COLOR, "c", divisor=0)
    with pytest.raises(ValueError, match=r"unknown uniform type 'vec5', did you mean 'vec\d'"):
        Uniform("vec5", "v")


def test_ports_are_inherited_in_order_of_declaration() -> None:
    class More(Temporal):
        in_normal = In("n")
        prev_depth = Prev("z")

    assert More.ports.samplers == ("in_color", "in_mask", "prev_color", "in_normal", "prev_depth")
    assert list(More.ports.outs) == ["out_color", "out_moments"]


def test_every_uniform_needs_a_value_and_no_other_is_taken() -> None:
    with pytest.raises(GraphError, match=r"Blur: 'u_step' \(\[1;\] distance of the taps in pixels\) needs a value"):
        Blur()
    with pytest.raises(GraphError, match=r"no uniform 'u_stpe', did you mean 'u_step'\?"):
        Blur(u_stpe=1)
    with pytest.raises(GraphError, match="FragmentPass has no shader"):
        FragmentPass()


def test_defines_become_text() -> None:
    work = Show(defines={"RADIUS": 2, "ON": True, "SIGMA": 4.0, "TINY": 1e-6, "NAME": "rgba8"})
    assert work.defines == {"RADIUS": "2", "ON": "1", "SIGMA": "4.0", "TINY": "1e-06", "NAME": "rgba8"}
    with pytest.raises(GraphError, match="not a finite number"):
        Show(defines={"A": float("nan")})
    with pytest.raises(GraphError, match="define 'radius'"):
        Show(defines={"radius": 1})


def test_program_key_tells_variants_apart() -> None:
    def key(work: Show, fmt: str = COLOR) -> tuple[object, ...]:
        g = Graph()
        g.output("d", g.add(work, in_color=g.import_("a", fmt)).out_color)
        return g.compile().passes[0].program

    same = key(Show(defines={"A": 1, "B": 2}))
    assert same == key(Show(defines={"B": 2, "A": 1}))
    assert same == key(Show(defines={"A": 1, "B": 2}), "rgba8")
    others = [Show(), Show(defines={"A": 1.0, "B": 2}), Show(defines={"A": 1, "B": 2}, formats={"out_color": COLOR})]
    assert len({same, *map(key, others), key(Show(defines={"A": 1, "B": 2}), "rgba32ui")}) == 5


def test_formats_can_be_overridden_per_instance() -> None:
    g = Graph()
    assert g.add(Source(formats={"out_color": "rgba32f"})).out_color.fmt == "rgba32f"
    assert g.add(Source()).out_color.fmt == COLOR
    with pytest.raises(GraphError, match="no output 'out_colour', did you mean 'out_color'"):
        Source(formats={"out_colour": COLOR})
    with pytest.raises(GraphError, match=r"Source\.out_color: unknown texture format 'rgb9'"):
        Source(formats={"out_color": "rgb9"})


def test_work_groups_round_up_and_reach_the_shader() -> None:
    assert Tiles().work_groups((17, 8)) == (3, 1)
    work = Tiles(group=(32, 4))
    assert work.work_groups((33, 9)) == (2, 3)
    assert work.defines == {"GROUP_X": "32", "GROUP_Y": "4"}
    with pytest.raises(GraphError, match="at least 1"):
        Tiles(group=(0, 8))


# ---------------------------------------------------------------------------------------------------------- wiring


def test_names_scopes_and_numbers() -> None:
    g = Graph()
    with g.scope("a"), g.scope("b"):
        assert g.add(Source()).out_color.name == "a.b.source.out_color"
        assert g.add(Source()).out_color.name == "a.b.source2.out_color"
    assert g.add(Source()).out_color.name == "source.out_color"
    assert g.add(Source(), "other").out_color.name == "other.out_color"
    with pytest.raises(GraphError, match="two passes 'other'"):
        g.add(Source(), "other")

    class RGBToYCoCg2(Source):
        pass

    assert g.add(RGBToYCoCg2()).out_color.name == "rgb_to_y_co_cg2.out_color"


def test_scope_ends_when_its_block_raises() -> None:
    g = Graph()
    with pytest.raises(GraphError), g.scope("a"):
        g.add(Show())
    assert g.add(Source()).out_color.name == "source.out_color"


def test_wrong_inputs_are_named() -> None:
    g = Graph()
    tex, history = g.import_("noisy", COLOR), g.history("h", COLOR)
    with pytest.raises(
        GraphError, match=r"blur has no input 'in_colour', did you mean 'in_color'\? \(inputs: in_color\)"
    ):
        g.add(Blur(u_step=1), in_colour=tex)
    with pytest.raises(GraphError, match=r"blur\.in_color \(colour to blur\) is not connected"):
        g.add(Blur(u_step=1))
    with pytest.raises(GraphError, match=r"temporal\.prev_color \(accumulated colour\) is not connected"):
        g.add(Temporal(), in_color=tex)
    with pytest.raises(GraphError, match=r"blur\.in_color reads a texture of this frame, got history 'h'"):
        g.add(Blur(u_step=1), in_color=history)
    with pytest.raises(GraphError, match=r"temporal\.prev_color reads a history, got texture 'noisy'"):
        g.add(Temporal(), in_color=tex, prev_color=tex)
    with pytest.raises(GraphError, match=r"blur\.in_color: texture 'noisy' belongs to another graph"):
        g.add(Blur(u_step=1), in_color=Graph().import_("noisy", COLOR))
    with pytest.raises(GraphError, match="belongs to another graph"):
        g.output("display", Graph().import_("noisy", COLOR))
    with pytest.raises(AttributeError, match="source has no output 'out_colour', did you mean 'out_color'"):
        _ = g.add(Source()).out_colour


def test_a_refused_pass_leaves_no_trace() -> None:
    g = Graph()
    with pytest.raises(GraphError):
        g.add(Temporal(), "t", in_color=g.import_("noisy", COLOR))
    added: Outputs = g.add(Source(), "t")
    g.output("display", added.out_color)
    assert [node.name for node in g.compile().passes] == ["t"]


def test_imports_and_histories_by_name() -> None:
    g = Graph()
    assert g.import_("a", COLOR) is g.import_("a", COLOR)
    assert g.history("h", COLOR) is g.history("h", COLOR)
    with pytest.raises(GraphError, match=r"import 'a' as r8: .* \(an import, rgba16f\)"):
        g.import_("a", "r8")
    with pytest.raises(GraphError, match=r"history 'h' is rgba16f with divisor 1, asked for rg32f"):
        g.history("h", "rg32f")
    with pytest.raises(GraphError, match="asked for rgba16f with divisor 2"):
        g.history("h", COLOR, divisor=2)
    with pytest.raises(GraphError, match="import 'b': unknown texture format 'rgba61f', did you mean 'rgba16f'"):
        g.import_("b", "rgba61f")
    with pytest.raises(GraphError, match="history 'b': unknown texture format"):
        g.history("b", "rgb")
    g.add(Source())
    with pytest.raises(GraphError, match=r"written by 'source'"):
        g.import_("source.out_color", COLOR)


def test_feeding_mistakes() -> None:
    g = Graph()
    noisy, a, b = g.import_("noisy", COLOR), g.history("a", COLOR), g.history("b", COLOR)
    t = g.add(Temporal(), in_color=noisy, prev_color=a)
    with pytest.raises(GraphError, match="history 'a' cannot be fed by import 'noisy'"):
        g.feed(a, noisy)
    with pytest.raises(GraphError, match=r"history 'a' is rgba16f .* but 'temporal\.out_moments' is rg32f"):
        g.feed(a, t.out_moments)
    g.feed(a, t.out_color)
    with pytest.raises(GraphError, match=r"history 'a' is already fed by 'temporal\.out_color'"):
        g.feed(a, blur(g, noisy))
    with pytest.raises(GraphError, match=r"'temporal\.out_color' already feeds history 'a', it cannot also feed 'b'"):
        g.feed(b, t.out_color)


def test_the_graph_needs_no_opengl() -> None:
    code = "import sys; import gl.graph, gl.interface; sys.exit('moderngl' in sys.modules)"
    assert subprocess.run([sys.executable, "-c", code], check=False).returncode == 0
