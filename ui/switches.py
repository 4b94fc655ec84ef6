"""What keys switch, as the panel shows it: made from the key table, never a second list."""

from __future__ import annotations

from typing import Final, NamedTuple

from ui.keys import BINDINGS, Action, Binding
from ui.state import UNFILTERED, State
from ui.status import Status

_PARAMETERS: Final = (Action.NEXT, Action.STAGE, Action.COUNT)
_OTHERS: Final = (
    *(Action.JITTER, Action.FLIP, Action.ANIMATE, Action.VIEW, Action.RESOLUTION),
    *(Action.PATH, Action.RECORD),
)
_NAMELESS: Final = ("enabled", "mode")
"""Parameters that go by the name of their section."""

_ARROWS: Final = {"Left": "\u2190", "Right": "\u2192", "Up": "\u2191", "Down": "\u2193"}


class Switch(NamedTuple):
    """One thing that keys change.

    Attributes:
        bindings: the keys that change it, of which the first one does what a click does.
        name: what it is called.
        value: its state in words; a ``bool`` of something that is just on or off; None where the method has none of it.
    """

    bindings: tuple[Binding, ...]
    name: str
    value: str | bool | None

    @property
    def keys(self) -> str:
        """Its keys in short."""
        return " ".join(_ARROWS.get(binding.label, binding.label) for binding in self.bindings)


def switches(state: State, status: Status) -> list[Switch]:
    """Everything that keys switch, in the order of the key table; keys that change the same thing stand together."""
    together: dict[str, list[Binding]] = {}
    for binding in BINDINGS:
        if binding.action in (*_PARAMETERS, *_OTHERS):
            together.setdefault(_target(binding).partition("/")[0], []).append(binding)
    return [Switch(tuple(same), _name(same[0], state), _value(same[0], state, status)) for same in together.values()]


def uses(state: State, section: str) -> bool:
    """Whether the method shown reads parameters of this section of the configuration."""
    match section:
        case "taa":
            return state.denoiser not in UNFILTERED
        case "firefly":
            return state.denoiser != "reference"
    return section in (*state.sections, "display", "render")


def _target(binding: Binding) -> str:
    """What a key acts on: a parameter, a switch of the state, or whatever its action is about."""
    named = binding.action in _PARAMETERS or binding.action is Action.FLIP
    return binding.value.partition(" ")[0] if named else binding.action.name.lower()


def _name(binding: Binding, state: State) -> str:
    target = _target(binding)
    section, _, keys = target.rpartition(".")
    key, _, others = keys.partition("/")
    if others and (found := state.parameter(target)):
        key = found[0].partition(".")[2]
    return (section if key in _NAMELESS else key).replace("_", " ")


def _value(binding: Binding, state: State, status: Status) -> str | bool | None:
    match binding.action:
        case Action.FLIP:
            return bool(getattr(state, binding.value))
        case Action.JITTER:
            return state.jitter
        case Action.ANIMATE:
            return state.animate
        case Action.VIEW:
            return state.view or "picture"
        case Action.PATH:
            return state.path
        case Action.RECORD:
            return state.recording
        case Action.RESOLUTION:
            return f"{status.size[0]}×{status.size[1]}"
    found = state.parameter(_target(binding))
    if found is None or not uses(state, found[0].partition(".")[0]):
        return None
    value = state.value(found[0])
    return value if isinstance(value, bool) else f"{value:g}" if isinstance(value, float) else str(value)
