"""Draw docs/figures/response_curves.png, thesis Fig. 5.1; `make figures` runs this script.

The upper panel shows the shift of the phase by a pulse, the lower one the change of the order parameter of two
oscillators by the pulse of one of them (eq. 5.8).
"""

from pathlib import Path

import numpy as np
from matplotlib.figure import Figure

from epuck_sim.particles.phase_response import CURVES, Response, order_change, phase_shift

SHOWN = {"multiplicative": (0.1, 0.0), "sawtooth": (0.5, 0.2), "sine": (0.08, 0.0)}
"""Coupling and refractory period of each curve, as in the thesis's figure."""

OUT = Path(__file__).with_suffix(".png")


def draw() -> None:
    """Draw both panels."""
    phases = np.linspace(0, 1, 2001)
    figure = Figure(figsize=(6, 5.5), layout="constrained")
    above, below = figure.subplots(2, 1, sharex=True)
    for name, (coupling, refractory) in SHOWN.items():
        response = Response(CURVES.index(name), coupling, refractory)
        letter = "ε" if name == "multiplicative" else "κ"
        above.plot(phases, phase_shift(response, phases), label=f"{name}, {letter} = {coupling}, D = {refractory}")
        below.plot(phases, order_change(response, phases))
    for axes in (above, below):
        axes.axhline(0, color="0.7", linewidth=0.8, zorder=0)
    above.set_ylabel("(a)  shift Ψ(ϕ)")
    below.set_ylabel("(b)  order parameter change Δr(ϕ)")
    below.set_xlabel("phase ϕ")
    above.legend(fontsize="small")
    figure.savefig(OUT, dpi=120)


if __name__ == "__main__":
    draw()
