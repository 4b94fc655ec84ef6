"""The numbers on the left: method, switches with their keys, times, history, what went wrong."""

from __future__ import annotations

from itertools import groupby
from typing import Final, NamedTuple

from imgui_bundle import ImVec2, imgui

from gl.executor import Result
from gl.pipelines import DENOISERS
from gl.profiler import Row
from gl.resources import VALID
from ui import theme, widgets
from ui.keys import BINDINGS, Action
from ui.live_error import MAP_TOP
from ui.state import State
from ui.status import Status
from ui.switches import Switch, switches

WIDTH: Final = 21.0
"""In em."""

_SECONDS_PER_DOT: Final = 0.4


def draw(state: State, status: Status) -> None:
    """The window with the numbers, and one with what went wrong, if anything did."""
    with widgets.window("numbers", (0.0, 0.0), WIDTH, imgui.WindowFlags_.no_title_bar), widgets.tight():
        _head(status)
        _methods(state)
        _switches(state, status)
        if status.result is not None:
            _error(state, status)
            _history(status, status.result)
            _frame(status, status.result)
        _times(status)
    if status.errors:
        _errors(status.errors)


def _head(status: Status) -> None:
    with widgets.font_size(theme.LARGE):
        widgets.text(f"{status.fps:.1f} fps")
        widgets.text_right(f"{1e3 / status.fps:.0f} ms" if status.fps > 0.0 else "", theme.DIM)
    triangles = f" · {status.triangles:,} triangles" if status.triangles else ""
    widgets.text(f"{status.scene} · {status.size[0]}×{status.size[1]}{triangles}")
    with widgets.font_size(theme.SMALL):
        widgets.text(status.renderer.partition(" (")[0], theme.FAINT)
        if status.progress:
            dots = 1 + int(imgui.get_time() / _SECONDS_PER_DOT) % 3
            widgets.text(f"{status.progress} {'.' * dots}", theme.WARNING, wrap=True)


def _methods(state: State) -> None:
    """A button for every method that has a key; the one shown is lit."""
    space = 0.0  # left on the line
    for binding in BINDINGS:
        if binding.action in (Action.SHOW, Action.PREVIOUS):
            lit = binding.value == state.denoiser
            text = f"{binding.label}  {binding.value or state.before}"
            width = imgui.calc_text_size(text).x + 2.0 * imgui.get_style().frame_padding.x
            if space and width > space:
                imgui.new_line()
            if binding.action is Action.SHOW and lit:
                imgui.push_style_color(imgui.Col_.button, theme.LIT)
            if imgui.button(f"{text}##method"):
                state.perform(binding)
            if lit:
                imgui.pop_style_color()
            widgets.tooltip(binding.help)
            imgui.same_line()
            space = imgui.get_content_region_avail().x
    imgui.new_line()
    if state.denoiser not in {binding.value for binding in BINDINGS}:
        widgets.text(f"{state.denoiser}: {DENOISERS[state.denoiser]}", theme.DIM, wrap=True)


def _switches(state: State, status: Status) -> None:
    widgets.heading("keys")
    with widgets.font_size(theme.SMALL):
        if imgui.begin_table("switches", 2, imgui.TableFlags_.sizing_stretch_same):
            for switch in switches(state, status):
                imgui.table_next_column()
                _switch(state, switch)
            imgui.end_table()


def _switch(state: State, switch: Switch) -> None:
    """Key, name, and how it stands; a click is like the first of its keys."""
    corner = imgui.get_cursor_screen_pos()
    width = imgui.get_content_region_avail().x - widgets.em(0.4)
    imgui.begin_disabled(switch.value is None)
    if imgui.selectable(f"##switch {switch.name}", False, size=ImVec2(0.0, imgui.get_text_line_height()))[0]:
        state.perform(switch.bindings[0])
    imgui.end_disabled()
    described = "\n".join(f"{binding.label}: {binding.help}" for binding in switch.bindings)
    words = "" if isinstance(switch.value, bool) else switch.value
    widgets.tooltip(described, note=f"{state.denoiser} has none" if words is None else words)
    middle, right = corner.y + 0.5 * imgui.get_text_line_height(), corner.x + width
    on = switch.value is not None and switch.value is not False
    imgui.push_clip_rect(corner, ImVec2(right, corner.y + 2.0 * imgui.get_text_line_height()), True)
    x = corner.x + widgets.key_cap(corner.x, middle, switch.keys, theme.DIM if on else theme.FAINT) + widgets.em(0.4)
    x += widgets.put(x, middle, switch.name, theme.TEXT if on else theme.DIM if words is not None else theme.FAINT)
    if isinstance(switch.value, bool):
        widgets.pill(right, middle, switch.value, theme.ACCENT)
    elif words:
        widgets.put(max(right - imgui.calc_text_size(words).x, x + widgets.em(0.4)), middle, words, theme.ACCENT)
    imgui.pop_clip_rect()


class Branch(NamedTuple):
    """A line of the table of times: a pass, or the sum of several, which are its ``parts``."""

    name: str
    milliseconds: float
    parts: tuple[Branch, ...] = ()


def branches(rows: list[Row]) -> list[Branch]:
    """Passes in their order; those of a scope under its name, and in it those that differ by a number only."""
    found: list[Branch] = []
    for scope, same in groupby(rows, key=lambda row: row.name.rpartition(".")[0]):
        leaves = [Branch(row.name, row.milliseconds) for row in same]
        if not scope or len(leaves) == 1:
            found += leaves
            continue
        leaves = [leaf._replace(name=leaf.name.removeprefix(f"{scope}.")) for leaf in leaves]
        stems = (list(alike) for _, alike in groupby(leaves, key=lambda leaf: leaf.name.rstrip("0123456789")))
        found.append(_sum(scope, [_sum(alike[0].name.rstrip("0123456789"), alike) for alike in stems]))
    return found


def _sum(name: str, parts: list[Branch]) -> Branch:
    return parts[0] if len(parts) == 1 else Branch(name, sum(part.milliseconds for part in parts), tuple(parts))


def _times(status: Status) -> None:
    """Tracing, then every pass, with bars that are comparable with one another."""
    widgets.heading("milliseconds")
    filtering = sum(row.milliseconds for row in status.passes)
    longest = max(status.trace_ms, filtering, 1e-6)
    with widgets.font_size(theme.SMALL):
        _time(Branch(status.work, status.trace_ms), longest)
        if status.passes:
            _time(Branch("filters", filtering, tuple(branches(status.passes))), longest, opened=2)


def _time(branch: Branch, longest: float, opened: int = 0) -> None:
    """One line and, if it is opened, its parts. ``opened``: how many levels are so at first."""
    widgets.bar(branch.milliseconds / longest)
    flags = int(imgui.TreeNodeFlags_.span_avail_width)
    flags |= imgui.TreeNodeFlags_.default_open if opened else 0
    flags |= 0 if branch.parts else imgui.TreeNodeFlags_.leaf
    is_open = imgui.tree_node_ex(branch.name, flags)
    widgets.text_right(f"{branch.milliseconds:.1f}", theme.DIM if branch.parts else theme.TEXT)
    if is_open:
        for part in branch.parts:
            _time(part, longest, opened - 1)
        imgui.tree_pop()


def _error(state: State, status: Status) -> None:
    """How far the picture is from a reference of the same view; or why there is none."""
    widgets.heading("error")
    with widgets.font_size(theme.SMALL):
        found = status.errors_now
        if found is None:
            widgets.text("tracing a reference" if status.resting else "while nothing moves", theme.DIM)
            widgets.tooltip("Once the camera rests and the animation is stopped (Space), a reference is traced.")
            return
        below = found.rmse < found.noise
        rmse = f"< {found.noise:.4f}" if below else f"{found.rmse:.4f}"
        widgets.text(f"RMSE {rmse}", theme.DIM if below else theme.TEXT)
        widgets.tooltip("Of linear radiance without light sources, before anti-aliasing.")
        imgui.same_line()
        widgets.text(f"PSNR {found.psnr:.1f} dB  FLIP {found.flip:.4f}")
        widgets.text(f"reference: {found.samples:,} paths, its own RMSE {found.noise:.4f}", theme.DIM)
        if state.error_map:
            widgets.text(f"map: FLIP from 0, black, to {MAP_TOP:g} and more", theme.DIM)


def _history(status: Status, result: Result) -> None:
    """Whether this frame could use what was accumulated before it, otherwise why not; and since when it can."""
    widgets.heading("history")
    with widgets.font_size(theme.SMALL):
        if not result.histories:
            widgets.text("the method has none", theme.DIM)
        for reason, names in by_reason(result.histories).items():
            valid = reason == VALID
            since = f", {status.frames:,} frames since: {status.lapse}" if valid and status.lapse else ""
            widgets.text(f"{reason} ({len(names)})", theme.GOOD if valid else theme.WARNING)
            widgets.tooltip("\n".join(names))
            imgui.same_line(0.0, 0.0)
            widgets.text(since, theme.DIM)


def by_reason(histories: dict[str, str]) -> dict[str, list[str]]:
    """``"valid"`` or the reason why not, with the names of the histories; trouble first."""
    found: dict[str, list[str]] = {}
    for name, reason in histories.items():
        found.setdefault(reason, []).append(name)
    return dict(sorted(found.items(), key=lambda item: item[0] == VALID))


def _frame(status: Status, result: Result) -> None:
    widgets.heading("frame")
    with widgets.font_size(theme.SMALL):
        if status.bad is not None:
            samples, pixels = status.bad
            widgets.text(
                f"NaN, Inf: {samples:,} samples, {pixels:,} pixels", theme.BAD if any(status.bad) else theme.DIM
            )
        plan = result.plan
        megabytes = plan.bytes(status.size) / 1e6
        widgets.text(f"passes {len(plan.passes)}, barriers {result.barriers}, {megabytes:.1f} MB", theme.DIM)
        widgets.tooltip("GPU memory of slots and histories, uploads apart")


def _errors(errors: list[str]) -> None:
    """What compilers and loaders say, as they wrote it; below the picture's middle, between the other windows."""
    beside = imgui.get_io().display_size.x / widgets.em(1.0) - 2.0 * WIDTH - 6.0
    with widgets.window("errors", (0.5, 1.0), max(beside, WIDTH), imgui.WindowFlags_.no_title_bar, (0.9, 0.3)):
        imgui.push_font(theme.code_font(), theme.SMALL)
        for error in errors:
            widgets.text(error, theme.BAD, wrap=True)
        imgui.pop_font()
