"""Presets: the values that a paper, a known implementation or our own measurements give to a method's parameters."""

from __future__ import annotations

from parameter import Value

PRESETS: dict[str, dict[str, dict[str, Value]]] = {
    "svgf": {
        # Schied et al. 2017: temporal filter (sec. 4.1), iterations and feedback (4.3), edge-stopping functions (4.4).
        "paper": {
            "alpha": 0.2,
            "alpha_moments": 0.2,
            "iterations": 5,
            "feedback_level": 0,
            "sigma_z": 1.0,
            "sigma_n": 128,
            "normal_history": 0,
            "sigma_l": 4.0,
            "first_sigma_l": 1.0,
            "accumulated_variance": False,
            "prefilter": False,
            "separate": True,
            "temporal": True,
            "variance_guided": True,
            "demodulate": True,
        },
        # Falcor's SVGFPass, the best-known implementation; gl/passes/svgf.py tells what else is different there.
        "reference": {
            "alpha": 0.05,
            "alpha_moments": 0.2,
            "max_history": 32,
            "iterations": 4,
            "feedback_level": 1,
            "sigma_z": 1.0,
            "sigma_n": 128,
            "normal_history": 0,
            "sigma_l": 10.0,
            "first_sigma_l": 1.0,
            "accumulated_variance": False,
            "separate": False,
            "temporal": True,
            "variance_guided": True,
            "demodulate": True,
            "prefilter": True,
        },
        # What measured best in error and time on flights through both scenes (docs/filters.md).
        "best": {
            "alpha": 0.07,
            "iterations": 3,
            "feedback_level": -1,
            "sigma_n": 64,
            "normal_history": 32,
            "sigma_l": 6.0,
            "first_sigma_l": 4.0,
            "accumulated_variance": True,
            "prefilter": True,
        },
    },
    "bmfr": {
        # Koskela et al. 2019: preprocessing, feature fitting, postprocessing.
        "paper": {
            "follow_motion": False,
            "round_history": True,
            "alpha": 0.2,
            "alpha_fit": 0.1,
            "features": "1,n,w,w2",
            "block": 32,
            "part": 0,
            "unit_scale": False,
            "regularization": "noise",
            "noise": 0.01,
            "temporal": True,
            "fit": True,
            "demodulate": True,
        },
        # The authors' OpenCL code, where it differs from the paper.
        "reference": {
            "follow_motion": False,
            "round_history": False,
            "alpha": 0.2,
            "alpha_fit": 0.1,
            "features": "1,n,w,w2",
            "block": 32,
            "part": 0,
            "unit_scale": True,
            "regularization": "noise",
            "noise": 0.01,
            "temporal": True,
            "fit": True,
            "demodulate": True,
        },
        # What measured best in error at equal time on flights through both scenes (docs/bmfr.md).
        "best": {"block": 24, "part": 12, "regularization": "both"},
    },
}
PRESETS["asvgf"] = {
    # Schied et al. 2018, on top of their SVGF.
    "paper": {
        **PRESETS["svgf"]["paper"],
        "remember": "random",
        "gradient_iterations": 5,
        "gradient_guided": True,
        "gain": 1.0,
        "follow": False,
        "widen": False,
        "cut": "harmonic",
    },
    # The authors' own renderer (q2vkpt), as far as it is A-SVGF.
    "reference": {
        **PRESETS["svgf"]["paper"],
        "separate": False,
        "alpha": 0.075,
        "alpha_moments": 0.1,
        "remember": "random",
        "gradient_iterations": 5,
        "gradient_guided": True,
        "gain": 1.0,
        "follow": False,
        "widen": True,
        "cut": "harmonic",
    },
    # What measured best in moving and in still light (docs/asvgf.md).
    "best": {**PRESETS["svgf"]["best"], "gradient_iterations": 3, "gain": 1.0, "follow": True},
}
"""section -> value of its ``preset`` key -> values of the keys it owns. A key set by file or ``--set`` wins over it.

A key that another preset of the section owns has its default: see :func:`config.preset_values`.
"""
