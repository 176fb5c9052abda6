"""What environments show of a swarm: pictures of the arena from above, or a window."""

from typing import Literal

import gymnasium

from epuck_sim.environments.rewards import Situation
from epuck_sim.overhead.camera import Picture
from epuck_sim.overhead.render import ArenaView
from epuck_sim.scenario.embodied import EmbodiedScenario

RenderMode = Literal["rgb_array", "human"]
"""What `render` does: return a picture, or show it in a window."""

RENDER_MODES = ["human", "rgb_array"]


class Screen:
    """Draws the first swarm of a situation."""

    def __init__(self, scenario: EmbodiedScenario, render_mode: RenderMode | None) -> None:
        self._scenario = scenario
        self._mode = render_mode
        self._view: ArenaView | None = None

    def render(self, situation: Situation) -> Picture | None:
        """Return (height, width, 3) a picture of the arena from above, or show it; see `ArenaView`."""
        if self._mode is None:
            gymnasium.logger.warn("render() needs render_mode='rgb_array' or 'human'")
            return None
        if self._view is None:
            self._view = ArenaView(self._scenario)
        picture = self._view.draw(situation.poses[0], situation.ring_on[0], situation.movables[0])
        if self._mode == "rgb_array":
            return picture
        self._show(picture)
        return None

    def _show(self, picture: Picture) -> None:
        """Show a picture in a window."""
        from matplotlib import pyplot  # noqa: PLC0415 slow, and only windows need it

        if not hasattr(self, "_image"):
            self._window = pyplot.figure("epuck-sim", frameon=False)
            self._image = self._window.add_axes((0.0, 0.0, 1.0, 1.0)).imshow(picture)
        self._image.set_data(picture)
        pyplot.pause(0.001)

    def close(self) -> None:
        """Close the window, if there is one."""
        if hasattr(self, "_image"):
            from matplotlib import pyplot  # noqa: PLC0415 see `_show`

            pyplot.close(self._window)
            del self._image
