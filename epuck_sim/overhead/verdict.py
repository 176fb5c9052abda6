"""Judges whether a T_sync can be trusted: reasons to give none, doubts, and why a swarm was never synchronised."""

import math
from collections.abc import Iterator
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from epuck_sim import epuck
from epuck_sim.arrays import FloatArray, IntArray
from epuck_sim.overhead import synchrony
from epuck_sim.overhead.camera import CORNERS
from epuck_sim.overhead.flashes import CountedRings, FlashTable
from epuck_sim.overhead.identities import SURE, link_flashes
from epuck_sim.overhead.rings import DISC_LIGHT, searched

MOST = 0.75  # share of the robots that counts as most of them
MOST_OF_USUAL = 0.6  # the same if their number is unknown, relative to the mean number of flashes in a period
FEWEST_PER_ROBOT = 0.65  # flashes per robot and period below which some are missed
MOST_PER_ROBOT = 1.9  # flashes per robot and period above which something else flashes; coupling of 1 gave 1.86
FROM_BEGINNING = 1.6  # T_sync, in periods, below which a film shows the swarm only in synchrony
NEAR_ORDER = 0.75
"""Least order parameter at the last flashes of a film whose swarm may be synchronised, as flashes after its end may
advance phases. Of 400 trials of `thesis` that ended with T_sync 166 did not show it, and all of these had more, as had
34 % of 1,714 that were cut before."""
WORTH_NAMING = 0.8  # least order parameter that messages propose: with less, a swarm is hardly synchronised
LIGHT_TOLERANCE = 1.5  # factor by which spreads by the total light and by rings may differ without contradiction
LATE_PERIODS = 0.75  # largest time, in periods, by which the total light may be synchronised before the rings
MOST_BURNT = 0.15  # largest share of the flashes that may be burnt out to discs
MOST_DAZZLED = 0.002  # largest share of the floor that may always shine without a ring
MOST_UNSEEN = 0.05  # largest share of light of no ring: 0.01 where all were found, more with a rolling shutter
MORE_FLASHES = 0.25  # flashes per robot that may be seen too often before T_sync, which is a whole number, as for `run`
ENOUGH_BEFORE = 1.8  # flashes per robot before T_sync above which their number shows whether some are missed
GAP = 1.5  # shortest gap between frames, in median intervals: halfway to one dropped frame
SHORTEST_FRAMES = 1.25  # mean duration of flashes, in frames, below which some are never seen
COARSE = 3.0  # error of order parameters, relative to that of onsets known to a frame: (pi frame / period)^2 / 6
FEW = 5  # fewest flashes, or frames with light, that are judged
TWIN_S = 0.1  # largest difference between the beginnings, or the ends, of a flash and its mirror image
DIMMER = 0.8  # light of a mirror image, relative to that of its robot, at most
STRAIGHT_CM = 1.0  # distance aside of a mirror image from the line across the wall through its robot
COMMON_IMAGES = 0.1  # least share of all flashes that look like mirror images, if this is not chance
USUAL_PERIODS_S = (0.3, 60.0)  # bounds of periods in which robots are seen to flash; thesis 4.2.1 has 5 s
ENOUGH_RECURRENCES = 3  # fewest intervals of common flashes of the swarm that give its period
ENOUGH_CYCLES = 20  # fewest cycles of robots that are followed surely, whose longest give the robots' period
LONGEST_CYCLES = 0.9
"""Quantile of these cycles that is the period, as flashes that a robot sees only shorten cycles, and wrong links come
seldom: in 96 trials at 1.6 cm/s that were told a wrong period, this was the right one to 1 %."""
HIDING = 1.5  # given period, relative to the true one, from which on it may hide synchrony
OTHER_PERIOD = 0.05  # relative difference between true and given period that is doubtful; clocks differ by less
ENOUGH_PERIODS = 3.5  # periods in a film below which the estimated period may be wrong
WRONG_SIZE = 0.08  # relative error of the rings' size that makes the scale doubtful; blur and haze give half of it
TOO_FAR = "robots move too far between flashes to tell; give --period-s or --robots"
TILTED_DEG = 3.0  # tilt of a camera that makes positions doubtful if no corners are given


@dataclass(frozen=True, eq=False)
class Evidence:
    """Evidence of a film once its counts are evaluated."""

    counted: CountedRings  # counts and flashes, without rings that are always lit
    lit_always: int  # number of places with such rings
    period_s: float
    threshold_s: float
    sync: synchrony.Evaluation | None  # the first evaluation of the histogram that shows synchrony
    robots: int | None  # number of robots, if it is given
    period_is_given: bool
    order_parameter: float = synchrony.ORDER_PARAMETER  # order parameter from which the swarm is synchronised

    @cached_property
    def flashes(self) -> FlashTable:
        """The flashes, as columns."""
        return FlashTable.of(self.counted.flashes)

    @cached_property
    def span_s(self) -> tuple[float, float]:
        """Beginning and end of what was filmed."""
        return float(self.counted.times_s[0]), float(self.counted.times_s[-1])

    @cached_property
    def periods(self) -> synchrony.Periods:
        """The whole periods around flashes that hold flashes of most robots."""
        return synchrony.Periods(self.flashes.onset_s, self.period_s, self.span_s, self.usual_flashes)

    @cached_property
    def in_order_s(self) -> float | None:
        """Time, on the film's clock, when the onsets first had the order parameter of synchrony; None if never."""
        return self.periods.first_in_order_s(self.order_parameter)

    @cached_property
    def swarm(self) -> int:
        """Number of robots: the given one, or the number that flash in a period of a swarm that is nearly in step."""
        return self.robots or self.periods.robots()

    @cached_property
    def is_early(self) -> bool:
        """Whether the swarm is synchronised so soon that the film may not show it out of step."""
        return (self.in_order_s or math.inf) < self.span_s[0] + FROM_BEGINNING * self.period_s

    def unless_corners(self, hint: str) -> str:
        """Return a hint to give the floor's corners; it is empty if they are given."""
        return "" if self.counted.geometry.calibration == CORNERS else hint

    def cycles_at(self, time_s: float) -> int:
        """Return the mean number of flashes of a robot, up to and including those around a time, rounded up."""
        before = np.count_nonzero(self.flashes.onset_s <= time_s - self.period_s / 2)
        return 1 + math.ceil(int(before) / max(self.swarm, 1) - MORE_FLASHES)

    @cached_property
    def most_lit(self) -> int:
        """Largest number of rings lit at once in two consecutive frames."""
        counts = self.counted.counts
        return int(np.minimum(counts[1:], counts[:-1]).max(initial=0))

    @cached_property
    def flashes_per_period(self) -> float:
        """Mean number of flashes in a period, over the time without gaps between frames."""
        times_s = self.counted.times_s
        seen_s = float((synchrony.frame_ends(times_s, times_s[-1]) - times_s).sum())
        return len(self.counted.flashes) / seen_s * self.period_s

    @cached_property
    def usual_flashes(self) -> float:
        """Least number of flashes that counts as flashes of most robots; at least two."""
        return max(2.0, MOST_OF_USUAL * self.flashes_per_period if self.robots is None else MOST * self.robots)


def objections(evidence: Evidence) -> list[str]:
    """Return the reasons why nothing can be said about T_sync."""
    period_s = evidence.period_s
    if evidence.span_s[1] - evidence.span_s[0] < period_s:
        return [f"no whole period of {period_s:.4g} s was seen; check --period-s, or film for longer"]
    found = _about_robots(evidence)
    one_cm, two_cm = moves_cm(evidence)
    if not evidence.period_is_given and one_cm > 2 * two_cm + 1.0:
        said = f"the same places flash again after two periods of {period_s:.4g} s, not one"
        twice = f"the period may be {2 * period_s:.4g} s; give --period-s"
        found.append(f"{said}: two groups may flash in turn, and {twice}")
    if evidence.is_early and not found and may_be_half_a_period(evidence):
        in_turn = f"the period is {2 * period_s:.4g} s and two groups flash in turn"
        found.append(f"flashes are in step from the beginning, or {in_turn}; {TOO_FAR}")
    if not found and evidence.in_order_s is None:
        near = synchrony.order_at_end(evidence.flashes.onset_s, period_s, evidence.span_s[1], evidence.swarm)
        if near >= NEAR_ORDER:
            least = math.floor(100 * near) / 100
            said = f"the film ends too early to tell: at its last flashes the order parameter is at least {least:.2f}"
            further = "(`run` does with stop.further_cycles=2)"
            found.append(f"{said}; film for one more period of {period_s:.4g} s {further}")
    return found + _about_light(evidence)[0]


def _about_robots(evidence: Evidence) -> list[str]:
    """Return doubts about the number of robots, from the rings lit at once or the flashes in a period."""
    robots, most_lit, per_period = evidence.robots, evidence.most_lit, evidence.flashes_per_period
    if robots is not None and most_lit > robots:
        said = f"{most_lit} rings were lit at once, but there are {robots} robots"
        return [f"{said}: check --robots, or what else is lit"]
    if robots is not None and not FEWEST_PER_ROBOT <= per_period / robots <= MOST_PER_ROBOT:
        size = searched(evidence.counted.geometry.camera)
        few = f", or whether rings are burnt out or dim, or not {size}" if per_period < robots else ""
        said = f"there were {per_period:.1f} flashes per period, but there are {robots} robots"
        return [f"{said}: check --robots, --period-s, --fps{few}"]
    if evidence.sync is None:
        return []
    middles_s = (evidence.flashes.onset_s + evidence.flashes.end_s) / 2
    together = np.count_nonzero(np.abs(middles_s - evidence.sync.time_s) <= evidence.period_s / 2)
    if together >= evidence.usual_flashes:
        return []
    usual = f"a usual period {per_period:.1f}; give" if robots is None else f"there are {robots} robots; check"
    return [f"the narrow histogram holds {together} flashes, but {usual} --robots"]


def may_be_half_a_period(evidence: Evidence) -> bool:
    """Return whether an estimated period may be half of the true one, if two groups flash in turn.

    Robots that move by more than their diameter between flashes leave this open, unless their number is known.
    """
    is_known = evidence.period_is_given or evidence.robots is not None
    return not is_known and moves_cm(evidence)[0] > 2 * epuck.RADIUS_CM


def moves_cm(evidence: Evidence) -> tuple[float, float]:
    """Return the median distances from flashes to the nearest flash one and two periods later; 0 if there are few."""
    onsets_s, places_cm, period_s = evidence.flashes.onset_s, evidence.flashes.places_cm, evidence.period_s
    after = np.full((2, len(onsets_s)), np.inf)
    for nearest, delay_s in zip(after, (period_s, 2 * period_s), strict=True):
        first, then = synchrony.pairs_within(onsets_s, onsets_s, (delay_s - period_s / 4, delay_s + period_s / 4))
        np.minimum.at(nearest, first, np.hypot(*(places_cm[then] - places_cm[first]).T))
    both = after[:, np.isfinite(after).all(axis=0)]
    one_cm, two_cm = np.median(both, axis=1).tolist() if both.shape[1] >= FEW else (0.0, 0.0)
    return one_cm, two_cm


def _about_light(evidence: Evidence) -> tuple[list[str], list[str]]:
    """Return reasons, and doubts: contradictions of rings by the total light, which needs no shapes or sizes."""
    counted, sync = evidence.counted, evidence.sync
    by_light = np.rint(rings_by_light(counted.areas_px, counted.counts)).astype(np.int64)
    if not by_light.any():
        return [], []
    found = synchrony.evaluate(counted.times_s, by_light, evidence.period_s)
    whole = [each for each in found if each.coverage >= synchrony.MIN_COVERAGE]
    narrow_s = [each.time_s for each in whole if each.spread_s <= evidence.threshold_s / LIGHT_TOLERANCE]
    sync_s, late_s = math.inf if sync is None else sync.time_s, LATE_PERIODS * evidence.period_s
    near_s = [each.spread_s for each in whole if abs(each.time_s - sync_s) <= late_s]
    hint = evidence.unless_corners("; give --corners, --arena-cm and --height-cm")
    blame = f"rings are missed, or something else is lit{hint}"
    if narrow_s and narrow_s[0] < sync_s - late_s:
        at = f"is synchronised at {narrow_s[0] - evidence.span_s[0]:.1f} s, but the rings that are found are not"
        return [f"the total light {at}: {blame}"], []
    if near_s and min(near_s) > LIGHT_TOLERANCE * evidence.threshold_s:  # that few are in step is a reason of its own
        spread = f"is spread by {1000 * min(near_s):.0f} ms where the rings that are found are synchronised"
        return [], [f"the total light {spread}: {blame}"]
    return [], []


def rings_by_light(areas_px: IntArray, counts: IntArray) -> FloatArray:
    """Return (frames,) numbers of rings in the lit areas, by the usual area of a ring; 0 if few frames show light."""
    area = np.maximum(areas_px - np.quantile(areas_px, 0.05), 0.0)
    lit = (counts > 0) & (area > 0)
    usual_px = np.median(area[lit] / counts[lit]) if np.count_nonzero(lit) >= FEW else math.inf
    return np.asarray(area / usual_px)


def count_images(flashes: FlashTable) -> int:
    """Return the number of flashes that may be mirror images; 0 if this may be chance.

    Each is dimmer than another flash that is straight beside, above or below it, and begins and ends with it.
    """
    onset_s, end_s, places_cm, light = flashes.onset_s, flashes.end_s, flashes.places_cm, flashes.light
    one, two = synchrony.pairs_within(onset_s, onset_s, (-2 * TWIN_S, 2 * TWIN_S))
    off_s = np.maximum(np.abs(onset_s[one] - onset_s[two]), np.abs(end_s[one] - end_s[two]))
    off_cm = np.abs(places_cm[one] - places_cm[two]).min(axis=1)
    is_image = (off_s <= TWIN_S) & (off_cm <= STRAIGHT_CM) & (light[one] < DIMMER * light[two])
    images = len(np.unique(one[is_image]))
    return images if images >= max(FEW, COMMON_IMAGES * len(light)) else 0


def doubts(evidence: Evidence) -> list[str]:
    """Return sentences about doubtful lights, a doubtful geometry, number of robots, or period."""
    counted, flashes, geometry = evidence.counted, evidence.flashes, evidence.counted.geometry
    found = [*_doubts_about_frames(evidence)]
    if evidence.lit_always:
        said = f"rings that stayed lit for longer than half a period, and are left out: {evidence.lit_always}"
        lamps = evidence.unless_corners(", or leave out lamps beside the floor by --corners")
        found.append(f"{said}; check --period-s{lamps}")
    elif counted.dazzled > MOST_DAZZLED:
        said = f"{100 * counted.dazzled:.1f} % of the floor always shines as brightly as rings"
        hint = evidence.unless_corners(", or leave them out by --corners")
        found.append(f"{said}, which are not seen there: switch lamps and screens off{hint}")
    if counted.outside:
        said = f"rings outside of the floor, and left out: {counted.outside} in {len(counted.times_s)} frames"
        found.append(f"{said}; they are mirror images, rings of another arena, or --corners or --arena-cm are wrong")
    burnt = np.count_nonzero(flashes.light >= DISC_LIGHT)
    if burnt > MOST_BURNT * len(flashes.light):
        said = f"flashes whose rings are burnt out to discs: {burnt} of {len(flashes.light)}; lamps look the same"
        found.append(f"{said}; film with a shorter, fixed exposure")
    by_light = float(rings_by_light(counted.areas_px, counted.counts).sum())
    if by_light and (unseen := 1.0 - float(counted.counts.sum()) / by_light) > MOST_UNSEEN:
        found.append(
            f"{100 * unseen:.0f} % of the light is from no ring that was found: rings are burnt out, dim, of another "
            "size or cut by a rolling shutter, or something else shines; film with a shorter, fixed exposure and "
            f"more frames per second{evidence.unless_corners(', or give the corners by --corners')}"
        )
    corners, ring_size = "give the floor's corners by --corners", geometry.ring_size
    if math.isnan(ring_size) and any(counted.rings):  # described: the film may have been scaled or cropped since
        seen_cm = [ring.radius_cm for rings in counted.rings for ring in rings]
        ring_size = float(np.median(seen_cm)) / epuck.RING_RADIUS_CM
    if geometry.knows_floor and abs(ring_size - 1) > WRONG_SIZE:
        said = f"by {geometry.calibration}, rings come out {ring_size:.2f} times as large as they are"
        found.append(f"{said}: lengths and speeds may be as wrong; {corners} and its size by --arena-cm")
    if not geometry.knows_floor and geometry.tilt_deg >= TILTED_DEG:
        said = f"the camera seems to be tilted by {geometry.tilt_deg:.0f} degrees: positions depend on it"
        found.append(f"{said}; {corners}")
    before_s = math.inf if evidence.sync is None else evidence.sync.time_s - evidence.period_s / 2
    early = FlashTable(*(column[flashes.onset_s < before_s] for column in flashes))
    if not geometry.knows_floor and (images := count_images(early)):
        said = f"flashes that may be mirror images in the walls: {images}; they come with their robots' own flashes"
        found.append(f"{said} and do not change T_sync, but are counted as robots; {corners}")
    return found + _about_light(evidence)[1] + _doubts_about_numbers(evidence)


def _doubts_about_frames(evidence: Evidence) -> Iterator[str]:
    """Yield sentences about frames that are missing, or too far apart to show when flashes began."""
    intervals_s = np.diff(evidence.counted.times_s)
    usual_s = float(np.median(intervals_s))
    gaps_s = intervals_s[intervals_s > GAP * usual_s]
    if len(gaps_s):
        said = f"gaps longer than {GAP:g} times the usual {1000 * usual_s:.3g} ms between frames: {len(gaps_s)}"
        yield f"{said}, the longest {gaps_s.max():.3g} s; frames were dropped"
    error = COARSE * (math.pi * usual_s / evidence.period_s) ** 2 / 6
    ends = (evidence.order_parameter - error, min(evidence.order_parameter + error, 1.0))
    periods, flashes = evidence.periods, evidence.flashes
    first_s, last_s = (periods.first_in_order_s(order) or math.inf for order in ends)
    began_lit = evidence.counted.frames > len(evidence.counted.times_s)  # and robots start in the dark
    in_step_s = flashes.onset_s[flashes.onset_s <= (evidence.in_order_s or math.inf) + evidence.period_s / 2]
    order = np.abs(np.exp(2j * np.pi * in_step_s / evidence.period_s).mean())
    if evidence.is_early and order >= evidence.order_parameter and not began_lit:
        yield "flashes are in step from the film's beginning, which may be after T_sync; film robots from their start"
    is_short = np.mean(flashes.end_s - flashes.onset_s) < SHORTEST_FRAMES * usual_s
    if is_short or first_s < last_s - evidence.period_s / 2:
        said = f"frames come every {1000 * usual_s:.3g} ms, too seldom to see when flashes begin"
        yield f"{said}, on which T_sync depends here; film more frames per second"


def _doubts_about_numbers(evidence: Evidence) -> list[str]:
    found, period_s, swarm = [], evidence.period_s, evidence.swarm
    numbers = evidence.periods.numbers[evidence.periods.order >= evidence.order_parameter]
    if len(numbers):
        fewest, most = np.quantile(numbers, (0.1, 0.9), method="nearest").tolist()
        span = f"{fewest}" if fewest == most else f"{fewest} to {most}"
        seen = f"{span} flashes are seen in a period of the synchronised swarm"
        if evidence.robots and (numbers[0] < evidence.robots or most > evidence.robots):
            found.append(f"{seen}, {numbers[0]} at T_sync, but there are {evidence.robots} robots: check --robots")
        elif evidence.robots is None and fewest < most:
            found.append(f"{seen}, and the number of robots, by which flashes are divided, is not known; give --robots")
    begin_s, end_s = evidence.span_s
    span_s = begin_s, evidence.in_order_s or -math.inf
    before = synchrony.Periods(evidence.flashes.onset_s, period_s, span_s, 0.0).numbers
    usual = float(np.median(before)) if len(before) > ENOUGH_BEFORE * swarm else swarm
    if usual < swarm and not found:
        said = f"before T_sync {usual:g} flashes are usually seen in a period, but {swarm} robots flash once or more"
        hint = evidence.unless_corners(", or give --corners")
        found.append(f"{said}: some are missed, and T_sync is too low; fix the exposure{hint}")
    periods = (end_s - begin_s) / period_s
    if not evidence.period_is_given and periods < ENOUGH_PERIODS:
        said = f"the period of {period_s:.4g} s is estimated from only {periods:.1f} periods of film"
        found.append(f"{said}; better give --period-s")
    if not evidence.period_is_given and not USUAL_PERIODS_S[0] <= period_s <= USUAL_PERIODS_S[1]:
        said = f"the period is estimated, and robots hardly flash every {period_s:.3g} s"
        found.append(f"{said}; check --fps, or give --period-s")
    shown_s = _shown_period_s(evidence) if evidence.period_is_given else period_s
    if abs(shown_s / period_s - 1) > OTHER_PERIOD:
        said = f"robots flash every {shown_s:.3g} s, not every {period_s:.4g} s"
        found.append(f"{said}: check --period-s and --fps, or give --robots")
    if may_be_half_a_period(evidence):
        said = f"the period is estimated; {2 * period_s:.4g} s fits as well, if two groups flash in turn"
        found.append(f"{said}, and {TOO_FAR}")
    return found


def _shown_period_s(evidence: Evidence) -> float:
    """Return the period that the flashes show, of two the one nearer to the given period, which it is if none is shown.

    It is the time between common flashes of the synchronised swarm, or the longest between flashes of a robot that is
    followed surely. If the swarm is never synchronised, and the number of robots unknown, that of all rings is tried.
    """
    onsets_s, period_s = evidence.flashes.onset_s, evidence.period_s
    if evidence.in_order_s is None and evidence.robots is None:
        shown_s = synchrony.estimate_period_s(evidence.counted.times_s, evidence.counted.counts) or period_s
        if HIDING * shown_s <= period_s and replace(evidence, period_s=shown_s).in_order_s is not None:
            return shown_s
    since_s = onsets_s[onsets_s >= (math.inf if evidence.in_order_s is None else evidence.in_order_s)]
    together_s = np.diff(since_s[np.diff(since_s, prepend=-math.inf) > period_s / 4])
    shown = [float(np.quantile(together_s, 0.5))] if len(together_s) >= ENOUGH_RECURRENCES else []
    if not any(abs(shown_s / period_s - 1) <= OTHER_PERIOD for shown_s in shown):  # telling robots apart takes a while
        who = link_flashes(evidence.flashes, period_s, evidence.counted.geometry.floor_cm)
        own = [who.robot == number for number in range(who.robots)]
        cycles_s = np.concatenate([np.diff(onsets_s[each])[who.certainty[each][1:] >= SURE] for each in own])
        shown += [float(np.quantile(cycles_s, LONGEST_CYCLES))] if len(cycles_s) >= ENOUGH_CYCLES else []
    return min(shown, key=lambda shown_s: abs(shown_s - period_s), default=period_s)


def why_never(evidence: Evidence) -> str:
    """Return a sentence about the swarm's highest order parameter, and about the one that was needed."""
    most = evidence.periods.order.max(initial=0.0)
    if not most:
        return "no period has flashes of most robots, and a robot that flashes alone is in step with nobody"
    least = math.floor(100 * most) / 100
    enough = f"; --order-parameter {least:g} would be met" if least >= WORTH_NAMING else ""
    return f"the order parameter was {most:.3f} at most, {evidence.order_parameter:g} is needed{enough}"
