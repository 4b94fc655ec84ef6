"""Compiled plans without OpenGL: culling, histories, slots, dumps."""

from __future__ import annotations

from dataclasses import replace

import pytest

from config import Render
from gl.graph import ONE_TEXEL, Graph, GraphError, Out, Tex
from gl.plan import Slot, check_no_feedback, texture_bytes, texture_size
from parameter import parameters
from tests.unit.small_graphs import COLOR, Blur, Show, Source, Temporal, Tiles, blur, example

# --------------------------------------------------------------------------------------------- culling and histories


def names(g: Graph) -> tuple[list[str], list[str]]:
    plan = g.compile()
    return [node.name for node in plan.passes], [node.name for node in plan.culled]


def test_what_no_output_needs_is_culled() -> None:
    passes, culled = names(example())
    assert passes == ["svgf.temporal", "svgf.blur", "svgf.blur2", "svgf.blur3", "show"]
    assert culled == ["debug"]
    assert names(example(history_read=False)) == (["svgf.blur", "show"], ["debug"])


def test_a_graph_needs_an_output() -> None:
    g = Graph()
    g.add(Source())
    with pytest.raises(GraphError, match="no output"):
        g.compile()
    tex = g.import_("noisy", COLOR)
    g.output("a", tex)
    with pytest.raises(GraphError, match="two outputs 'a'"):
        g.output("a", tex)
    assert g.compile().imports == (tex,)  # an upload may go straight through


def test_a_history_read_keeps_its_feeder_and_that_one_s_inputs_alive() -> None:
    g = Graph()
    history = g.history("h", COLOR)
    t = g.add(Temporal(), in_color=g.import_("noisy", COLOR), prev_color=history)
    g.output("display", t.out_color)
    g.feed(history, blur(g, g.add(Source()).out_color))  # after its reader: no order follows from a history
    assert names(g) == (["temporal", "source", "blur"], [])


def test_a_history_that_nobody_reads_keeps_nothing_alive_and_takes_no_memory() -> None:
    g = Graph()
    tex = g.import_("noisy", COLOR)
    g.feed(g.history("dead", COLOR), blur(g, tex, "dead"))
    alive = blur(g, tex, "alive")
    g.feed(g.history("unread", COLOR), alive)
    g.output("display", alive)
    assert names(g) == (["alive"], ["dead"])
    plan = g.compile()
    assert (len(plan.slots), plan.feeds) == (1, {})


def test_a_history_read_by_culled_passes_only_keeps_nothing_alive() -> None:
    g = Graph()
    tex, history = g.import_("noisy", COLOR), g.history("h", COLOR)
    g.feed(history, g.add(Temporal(), in_color=tex, prev_color=history).out_color)
    g.output("display", tex)
    assert names(g) == ([], ["temporal"])


def test_a_history_that_is_read_must_be_fed() -> None:
    g = Graph()
    t = g.add(Temporal(), in_color=g.import_("noisy", COLOR), prev_color=g.history("h", COLOR))
    g.output("display", t.out_color)
    with pytest.raises(GraphError, match=r"temporal\.prev_color reads history 'h', which nothing feeds"):
        g.compile()


# ----------------------------------------------------------------------------------------------------------- slots


def chain(length: int) -> tuple[Graph, list[Tex]]:
    g = Graph()
    made = [g.add(Source()).out_color]
    for _ in range(length):
        made.append(blur(g, made[-1]))
    g.output("display", made[-1])
    return g, made


def test_a_chain_takes_turns_in_two_slots() -> None:
    g, made = chain(5)
    plan = g.compile()
    assert [plan.slot_of[tex] for tex in made] == [0, 1, 0, 1, 0, 1]
    assert plan.slots == (Slot(COLOR, 1, 0), Slot(COLOR, 1, 1))
    assert len(g.compile(alias=False).slots) == 6


def test_slots_are_shared_by_equal_format_and_divisor_only() -> None:
    g = Graph()
    x = g.add(Source()).out_color
    small = g.add(Tiles(), in_color=x).out_small
    smaller = g.add(Tiles(formats={"out_small": "rg32f"}), in_color=small).out_small
    full = g.add(Source(formats={"out_color": "r32f"})).out_color
    g.output("a", smaller)
    g.output("b", g.add(Tiles(), in_color=full).out_small)
    plan = g.compile()
    assert plan.slots == (
        Slot(COLOR, 1, 0),
        Slot("r32f", 3, 0),
        Slot("rg32f", 3, 0),
        Slot("r32f", 1, 0),
    )


def test_one_texel_is_one_texel_in_every_frame_there_can_be() -> None:
    largest = int(parameters(Render)["width"].hi or 0), int(parameters(Render)["height"].hi or 0)
    for size in ((1, 1), (640, 360), largest):
        assert texture_size(size, ONE_TEXEL) == (1, 1)
        assert texture_bytes(size, "rg32f", ONE_TEXEL) == 8
    g = Graph()
    mean = type("Mean", (Tiles,), {"out_small": Out("r32f", "s", ONE_TEXEL)})
    g.output("a", g.add(mean(), in_color=g.import_("noisy", COLOR)).out_small)
    assert "out_small:r32f(1x1)@0" in g.compile().text()


def test_outputs_kept_textures_and_feeders_are_never_written_over() -> None:
    g, made = chain(5)
    g.output("early", made[1])
    plan = g.compile(keep=(made[2].name, made[2].name))
    assert plan.keep == (made[2],)
    for tex in (made[1], made[2], made[5]):
        later = [plan.slot_of[other] for other in made[made.index(tex) + 1 :]]
        assert plan.slot_of[tex] not in later
        assert plan.final_textures()[tex.name] is tex
    assert made[0].name not in plan.final_textures()

    plan = example().compile()
    (feeder,) = plan.feeds
    assert feeder not in plan.slot_of


def test_final_textures_are_the_last_of_their_slots() -> None:
    g, made = chain(3)
    assert set(g.compile().final_textures()) == {made[2].name, made[3].name}
    assert set(g.compile(alias=False).final_textures()) == {tex.name for tex in made}


def test_keeping_what_is_not_made_is_refused_with_near_names() -> None:
    g = example()
    with pytest.raises(
        GraphError, match=r"'svgf\.temporal\.out_colour': no such texture, did you mean 'svgf\.temporal\.out_color'"
    ):
        g.compile(keep=("svgf.temporal.out_colour",))
    with pytest.raises(GraphError, match=r"cannot keep 'debug\.out_color': no output needs pass 'debug'.*svgf\.blur3"):
        g.compile(keep=("debug.out_color",))
    assert g.compile(keep=("noisy",)).keep[0].name == "noisy"


@pytest.mark.parametrize("alias", [True, False])
def test_no_pass_writes_what_it_reads(alias: bool) -> None:
    for g in (example(), chain(7)[0]):
        plan = g.compile(alias=alias)
        for node in plan.passes:
            reads = {plan.slot_of[tex] for tex in node.reads.values() if tex in plan.slot_of}
            writes = [plan.slot_of[tex] for tex in node.writes.values() if tex in plan.slot_of]
            assert reads.isdisjoint(writes)
            assert len(set(writes)) == len(writes)


def test_the_proof_finds_feedback() -> None:
    g, made = chain(2)
    plan = g.compile()
    with pytest.raises(GraphError, match=r"blur reads in_color<-source\.out_color from slot 1, which it also writes"):
        check_no_feedback(plan.passes, plan.slot_of | {made[0]: 1})
    t = g.add(Temporal(), in_color=made[0], prev_color=g.history("h", COLOR))
    g.feed(g.history("h", COLOR), blur(g, made[0]))
    g.output("t", t.out_moments)
    plan = g.compile()
    with pytest.raises(GraphError, match="temporal writes two outputs to one slot"):
        check_no_feedback(plan.passes, plan.slot_of | {t.out_color: 9, t.out_moments: 9})


def test_lifetimes_in_shared_slots_are_disjoint() -> None:
    plan = example().compile()
    written = {tex: i for i, node in enumerate(plan.passes) for tex in node.writes.values()}
    last = {tex: i for i, node in enumerate(plan.passes) for tex in node.reads.values()}
    for a, slot in plan.slot_of.items():
        for b, other in plan.slot_of.items():
            if a is not b and slot == other and written[a] <= written[b]:
                assert last.get(a, written[a]) < written[b]


def test_bytes_count_slots_once_and_histories_twice() -> None:
    plan = example().compile()
    color = sum(slot.fmt == COLOR for slot in plan.slots) + 2
    assert plan.bytes((10, 7)) == 70 * (8 * color + 8 + 4)  # + moments rg32f + display rgba8
    g = Graph()
    g.output("s", g.add(Tiles(), in_color=g.import_("a", COLOR)).out_small)
    assert g.compile().bytes((10, 7)) == 4 * 3 * 4  # ceil(10/3) x ceil(7/3) x r32f


# ----------------------------------------------------------------------------------------------------------- dumps

TEXT = """\
svgf.temporal  t/temporal.frag
    reads   in_color<-noisy, in_mask<-none
    prev    prev_color<~svgf.color
    writes  out_color:rgba16f@0, out_moments:rg32f@1
svgf.blur  t/blur.frag
    defines RADIUS=2
    reads   in_color<-svgf.temporal.out_color
    writes  out_color:rgba16f@~svgf.color
tiles  t/tiles.comp
    defines GROUP_X=8, GROUP_Y=8
    reads   in_color<-svgf.blur.out_color
    writes  out_small:r32f/3@2
output  display <- svgf.temporal.out_color
output  tiles <- tiles.out_small
keep    svgf.temporal.out_moments
history svgf.color <~ svgf.blur.out_color  rgba16f
-- culled show
-- 3 passes, 4 textures, 3 slots, 1 history
"""

DOT = """\
digraph frame {
  rankdir=LR; node [shape=box, fontname=monospace]; edge [fontname=monospace, fontsize=9];
  "noisy" [shape=ellipse];
  "svgf.temporal";
  "svgf.blur";
  "tiles";
  "show" [style=dashed, color=gray, fontcolor=gray];
  "noisy" -> "svgf.temporal" [label="in_color"];
  "svgf.blur" -> "svgf.temporal" [label="prev_color\\n~svgf.color", style=dotted, constraint=false];
  "svgf.temporal" -> "svgf.blur" [label="in_color"];
  "svgf.blur" -> "tiles" [label="in_color"];
  "svgf.blur" -> "show" [label="in_color"];
  "output display" [label="display", shape=doubleoctagon];
  "svgf.temporal" -> "output display";
  "output tiles" [label="tiles", shape=doubleoctagon];
  "tiles" -> "output tiles";
}
"""


def dumped(step: int = 1) -> Graph:
    g = Graph()
    history = g.history("svgf.color", COLOR)
    with g.scope("svgf"):
        t = g.add(Temporal(), in_color=g.import_("noisy", COLOR), prev_color=history)
        x = g.add(Blur(u_step=step, defines={"RADIUS": 2}), in_color=t.out_color).out_color
    g.feed(history, x)
    g.output("display", t.out_color)
    g.output("tiles", g.add(Tiles(), in_color=x).out_small)
    g.add(Show(), in_color=x)
    return g


def test_text_dump() -> None:
    assert dumped().compile(keep=("svgf.temporal.out_moments",)).text() == TEXT


def test_text_is_about_wiring_not_parameters() -> None:
    assert dumped(step=1).compile().text() == dumped(step=7).compile().text()


def test_dot_dump() -> None:
    assert dumped().compile().dot() == DOT


def test_plan_cannot_be_changed() -> None:
    plan = dumped().compile()
    with pytest.raises(AttributeError):
        plan.passes = ()  # type: ignore[misc]
    assert replace(plan, culled=()).text().count("culled") == 0
