"use strict";
// What a page draws: the arena, flashes, phases and order, and the figures of many trials. Pens draw on canvas or in SVG.

/** @typedef {{fill?: string, stroke?: string, width?: number, alpha?: number, align?: CanvasTextAlign, size?: number, dash?: number}} Style */
/** @typedef {{[name: string]: string}} Colours */

/** Largest radius, in pixels, of robots and agents without their numbers. */
const MOST_SMALL = 9;
/** Colour of what is drawn on the colour of a phase, which is bright, be the page light or dark. */
const ON_PHASE = "#1d2126";

/** Draws on a canvas, as sharp as the screen. */
class CanvasPen {
  /** @param {HTMLCanvasElement} canvas */
  constructor(canvas) {
    const { width, height } = canvas.getBoundingClientRect(), sharp = Math.min(window.devicePixelRatio || 1, 3);
    const [wide, high] = [width, height].map((side) => Math.max(1, Math.round(side * sharp)));
    if (canvas.width !== wide || canvas.height !== high) Object.assign(canvas, { width: wide, height: high });
    this.g = /** @type {CanvasRenderingContext2D} */ (canvas.getContext("2d"));
    this.width = width;
    this.height = height;
    this.g.setTransform(sharp, 0, 0, sharp, 0, 0);
    this.g.clearRect(0, 0, width, height);
  }

  /** @param {Style} style */
  paint({ fill, stroke, width = 1, alpha = 1, dash = 0 }) {
    const { g } = this;
    g.globalAlpha = alpha;
    g.setLineDash(dash ? [dash, dash] : []);
    if (fill) [g.fillStyle] = [fill], g.fill();
    if (stroke) [g.strokeStyle, g.lineWidth] = [stroke, width], g.stroke();
  }

  /** @param {number} x @param {number} y @param {number} radius @param {Style} style */
  circle(x, y, radius, style) {
    this.g.beginPath();
    this.g.arc(x, y, Math.max(radius, 0), 0, 2 * Math.PI);
    this.paint(style);
  }

  /** @param {number[][]} points @param {Style} style @param {boolean} closed */
  path(points, style, closed = false) {
    this.g.beginPath();
    for (const [x, y] of points) this.g.lineTo(x, y);
    if (closed) this.g.closePath();
    this.paint(style);
  }

  /** @param {number} x @param {number} y @param {string} words @param {Style} style */
  text(x, y, words, { fill = "", align = "center", size = 11 }) {
    Object.assign(this.g, { globalAlpha: 1, fillStyle: fill, textAlign: align, textBaseline: "middle", font: `${size}px system-ui, sans-serif` });
    this.g.fillText(words, x, y);
  }
}

/** Draws the same into the text of an SVG. */
class SvgPen {
  /** @param {number} width @param {number} height */
  constructor(width, height) {
    this.width = width;
    this.height = height;
    this.parts = /** @type {string[]} */ ([]);
  }

  /** @param {Style} style */
  static paint({ fill = "none", stroke = "none", width = 1, alpha = 1 }) {
    return `fill="${fill}" stroke="${stroke}" stroke-width="${width}" opacity="${alpha}"`;
  }

  /** @param {number} x @param {number} y @param {number} radius @param {Style} style */
  circle(x, y, radius, style) {
    this.parts.push(`<circle cx="${x.toFixed(2)}" cy="${y.toFixed(2)}" r="${radius.toFixed(2)}" ${SvgPen.paint(style)}/>`);
  }

  /** @param {number[][]} points @param {Style} style @param {boolean} closed */
  path(points, style, closed = false) {
    const line = points.map(([x, y]) => `${x.toFixed(2)} ${y.toFixed(2)}`).join(" L ");
    this.parts.push(`<path d="M ${line}${closed ? " Z" : ""}" ${SvgPen.paint(style)}/>`);
  }

  /** @param {number} x @param {number} y @param {string} words @param {Style} style */
  text(x, y, words, { fill = "", size = 11 }) {
    this.parts.push(`<text x="${x.toFixed(2)}" y="${(y + 0.35 * size).toFixed(2)}" fill="${fill}" font-size="${size}" font-family="sans-serif" text-anchor="middle">${words}</text>`);
  }

  get svg() {
    const { width, height } = this;
    return `<svg xmlns="http://www.w3.org/2000/svg" width="${width}" height="${height}" viewBox="0 0 ${width} ${height}">${this.parts.join("\n")}</svg>\n`;
  }
}

/** Return the present colours of the page, light or dark. @returns {Colours} */
function colours() {
  const style = getComputedStyle(document.documentElement);
  const names = ["paper", "ink", "faint", "rule", "box", "floor", "amber", "lit", "deep", "light"];
  return Object.fromEntries(names.map((name) => [name, style.getPropertyValue(`--${name}`).trim()]));
}

/** Return the colour of a phase, from 0 to 1 round the circle of colours; grey if there is no phase. @param {number} phase @param {Colours} colour */
function phaseColour(phase, colour) {
  return `hsl(${(5 + 360 * (phase || 0)) % 360}, ${Number.isNaN(phase) ? 0 : 58}%, ${colour.light})`;
}

/** @typedef {{width: number, height: number, floor: number[][], circles: number[][], polygons: number[][][], lamps: number[][], radii: Float64Array | null}} Place the arena, cm; points have no radii; boxes of the floor are in shares of its sides */
/** @typedef {{picture: Picture, glow: Float64Array, links: [number, number, number][], chosen: number, cones: {robot: number, half: number, reach: number}[]}} Shown */

/** Draw the arena from above; y goes up. @param {CanvasPen | SvgPen} pen @param {Place} place @param {Shown} shown @param {Colours} colour */
function drawArena(pen, place, shown, colour) {
  const { picture, glow, links, chosen, cones } = shown, margin = place.radii ? 3 : MOST_SMALL + 1; // points may stand on the rim
  const scale = Math.min((pen.width - 2 * margin) / place.width, (pen.height - 2 * margin) / place.height);
  const left = (pen.width - scale * place.width) / 2, low = (pen.height + scale * place.height) / 2;
  const at = (/** @type {number} */ x, /** @type {number} */ y) => [left + scale * x, low - scale * y];
  const corners = [at(0, 0), at(place.width, 0), at(place.width, place.height), at(0, place.height)];
  pen.path(corners, { fill: colour.floor }, true);
  for (const [west, north, east, south, level] of place.floor) {
    const [[x, y], [right, below]] = [at(west * place.width, north * place.height), at(east * place.width, south * place.height)];
    const grey = `rgb(${level},${level},${level})`;
    pen.path([[x, y], [right, y], [right, below], [x, below]], { fill: grey, stroke: grey, width: 1 }, true); // no gaps
  }
  pen.path(corners, { stroke: colour.faint, width: 1.5 }, true);
  for (const [x, y, radius] of place.circles) pen.circle(...pair(at(x, y)), scale * radius, { fill: colour.rule, stroke: colour.faint });
  for (const polygon of place.polygons) pen.path(polygon.map(([x, y]) => at(x, y)), { fill: colour.rule, stroke: colour.faint }, true);
  for (const [x, y, radius] of place.lamps) pen.circle(...pair(at(x, y)), scale * radius, { fill: colour.amber, stroke: colour.faint });
  for (const { robot, half, reach } of cones) {
    const steps = Math.max(2, Math.ceil(half / 0.15));
    const rim = Array.from({ length: 2 * steps + 1 }, (_, step) => picture.heading[robot] + (half * (step - steps)) / steps);
    const points = rim.map((angle) => at(picture.x[robot] + reach * Math.cos(angle), picture.y[robot] + reach * Math.sin(angle)));
    pen.path([at(picture.x[robot], picture.y[robot]), ...points], { fill: colour.deep, alpha: robot === chosen ? 0.2 : 0.07 }, true);
  }
  for (const [from, to, alpha] of links)
    pen.path([at(picture.x[from], picture.y[from]), at(picture.x[to], picture.y[to])], { stroke: colour.lit, width: 2, alpha });
  const size = place.radii ? scale * Math.max(...place.radii) : Math.min(MOST_SMALL, Math.max(3.5, pen.width / (12 * Math.sqrt(picture.x.length) + 30)));
  const sizeOf = (/** @type {number} */ agent) => (place.radii ? scale * place.radii[agent] : size);
  const isLit = (/** @type {number} */ agent) => (picture.is_lit ? picture.is_lit[agent] === 1 : glow[agent] > 0.4);
  glow.forEach((light, agent) => {
    const reach = sizeOf(agent) * (1.35 + (place.radii ? 0.6 : 2) * light);
    if (light > 0.15 || isLit(agent)) pen.circle(...pair(at(picture.x[agent], picture.y[agent])), reach, { fill: colour.lit, alpha: 0.2 + 0.3 * light });
  });
  for (let agent = 0; agent < picture.x.length; agent++) {
    const [x, y] = at(picture.x[agent], picture.y[agent]), heading = picture.heading[agent], wide = sizeOf(agent);
    pen.circle(x, y, wide, { fill: phaseColour(picture.phases[agent], colour), stroke: isLit(agent) ? colour.lit : colour.ink, width: isLit(agent) ? 3 : 1 });
    const inner = wide > MOST_SMALL ? 0.6 * wide : 0, ends = [inner, wide].map((far) => [x + far * Math.cos(heading), y - far * Math.sin(heading)]);
    pen.path(ends, { stroke: ON_PHASE, width: Math.max(1, wide / 6) });
    if (inner) pen.text(x, y, `${agent}`, { fill: ON_PHASE, size: 0.65 * wide });
    if (agent === chosen) pen.circle(x, y, wide + 4, { stroke: colour.deep, width: 2 });
  }
  return { scale, left, low, size };
}

/** @param {number[]} numbers @returns {[number, number]} */
function pair([one, other]) {
  return [one, other];
}

/** Return a number as text, with separators from 10,000 on. @param {number} value */
function number(value) {
  return Math.abs(value) >= 10_000 ? value.toLocaleString("en") : `${value}`;
}

/** Return a number with three digits. @param {number} value */
function rounded(value) {
  return number(+value.toPrecision(3));
}

/** Return about `about` round numbers between two. @param {number} low @param {number} high @param {number} about */
function ticks(low, high, about) {
  const rough = Math.max(high - low, 1e-12) / about, unit = 10 ** Math.floor(Math.log10(rough));
  const step = unit * ([1, 2, 5].find((each) => each * unit >= rough) ?? 10), first = Math.ceil(low / step - 1e-9);
  return Array.from({ length: Math.max(0, Math.floor(high / step + 1e-9) - first + 1) }, (_, each) => +((first + each) * step).toPrecision(10));
}

/** Return the powers of ten between two numbers, and their multiples by 2 and 5 if they are few. @param {number} low @param {number} high */
function logTicks(low, high) {
  const found = [], decades = Math.log10(high / low), many = decades > 2.2;
  if (!Number.isFinite(decades)) return [];
  for (let power = Math.floor(Math.log10(low)); power <= Math.log10(high); power++)
    for (const each of many ? [1] : [1, 2, 5]) found.push(+(each * 10 ** power).toPrecision(3));
  return found.filter((each) => each >= low * 0.999 && each <= high * 1.001);
}

/** Draw axes; return functions that place values, and the box. */
/** @param {CanvasPen} pen @param {{x: number[], y: number[], log?: boolean, xLabel?: string, yLabel?: string, bare?: boolean}} axes @param {Colours} colour */
function drawAxes(pen, { x, y, log = false, xLabel = "", yLabel = "", bare = false }, colour) {
  const box = { left: bare ? 20 : 42, right: pen.width - 14, top: yLabel ? 20 : 8, low: pen.height - (xLabel ? 36 : 20) };
  const part = (/** @type {number} */ value, /** @type {number[]} */ [low, high]) => (log ? Math.log(value / low) / Math.log(high / low) : (value - low) / (high - low));
  const placeX = (/** @type {number} */ value) => box.left + part(value, x) * (box.right - box.left);
  const placeY = (/** @type {number} */ value) => box.low - part(value, y) * (box.low - box.top);
  const found = log ? [logTicks(x[0], x[1]), logTicks(y[0], y[1])] : [ticks(x[0], x[1], pen.width / 80), ticks(y[0], y[1], pen.height / 50)];
  for (const value of found[0]) {
    pen.path([[placeX(value), box.low], [placeX(value), box.low + 4]], { stroke: colour.faint });
    pen.text(placeX(value), box.low + 12, number(value), { fill: colour.faint });
  }
  if (!bare)
    for (const value of found[1]) {
      pen.path([[box.left, placeY(value)], [box.right, placeY(value)]], { stroke: colour.rule });
      pen.text(box.left - 6, placeY(value), number(value), { fill: colour.faint, align: "right" });
    }
  pen.path([[box.left, box.low], [box.right, box.low]], { stroke: colour.faint });
  if (xLabel) pen.text((box.left + box.right) / 2, box.low + 28, xLabel, { fill: colour.faint });
  if (yLabel) pen.text(4, 8, yLabel, { fill: colour.faint, align: "left" });
  return { placeX, placeY, ...box };
}

/** Draw the order parameter against time. @param {CanvasPen} pen @param {number[][]} orders @param {number} least time that is shown @param {number} threshold @param {Colours} colour */
function drawOrders(pen, orders, least, threshold, colour) {
  const end = Math.max(orders.length ? orders[orders.length - 1][0] : 0, least);
  const { placeX, placeY, left, right } = drawAxes(pen, { x: [0, end], y: [orders.some(([, order]) => order < 0) ? -1 : 0, 1] }, colour); // cosines may be below 0
  if (threshold) {
    pen.path([[left, placeY(threshold)], [right, placeY(threshold)]], { stroke: colour.amber, dash: 4 });
    pen.text(left + 4, placeY(threshold) + 8, "synchronised", { fill: colour.amber, align: "left" });
  }
  pen.path(orders.map(([time, order]) => [placeX(time), placeY(order)]), { stroke: colour.deep, width: 1.75 });
}

/** Draw the flashes of agents against time. @param {CanvasPen} pen @param {number[][]} flashes time and agent @param {number} count @param {number[]} times @param {number} chosen @param {Colours} colour */
function drawFlashes(pen, flashes, count, times, chosen, colour) {
  const { placeX, placeY, left, right } = drawAxes(pen, { x: times, y: [count, 0], bare: true }, colour), high = Math.max(1.5, Math.min(14, (pen.height - 28) / count) - 1);
  if (high > MOST_SMALL) for (let agent = 0; agent < count; agent++) pen.text(2, placeY(agent + 0.5), `${agent}`, { fill: colour.faint, align: "left" });
  if (chosen >= 0) pen.path([[left, placeY(chosen + 0.5)], [right, placeY(chosen + 0.5)]], { stroke: colour.rule, width: high });
  for (const [time, agent] of flashes) {
    if (time < times[0]) continue;
    pen.g.fillStyle = agent === chosen ? colour.deep : colour.lit;
    pen.g.fillRect(placeX(time) - 1, placeY(agent + 0.5) - high / 2, 2, high); // of thousands, paths would take three times as long
  }
}

/** Draw phases on a circle, 0 at the top, and their mean. @param {CanvasPen} pen @param {Float64Array} phases @param {Colours} colour */
function drawPhases(pen, phases, colour) {
  const [x, y] = [pen.width / 2, pen.height / 2], radius = Math.min(x, y) - 9, seen = phases.filter((phase) => !Number.isNaN(phase));
  const at = (/** @type {number} */ phase, /** @type {number} */ far) => pair([x + far * Math.sin(2 * Math.PI * phase), y - far * Math.cos(2 * Math.PI * phase)]);
  pen.circle(x, y, radius, { stroke: colour.rule, width: 1.5 });
  pen.path([at(0, radius - 4), at(0, radius + 4)], { stroke: colour.amber, width: 2 });
  seen.forEach((phase) => pen.circle(...at(phase, radius), 5, { fill: phaseColour(phase, colour), stroke: colour.ink, width: 0.75, alpha: 0.9 }));
  const { order, phase } = meanPhase(seen);
  pen.path([[x, y], at(phase, order * radius)], { stroke: colour.deep, width: 3 });
}

/** Return modulus and angle, in shares of a turn, of the mean phasor. @param {Float64Array} phases */
function meanPhase(phases) {
  let cosines = 0, sines = 0;
  for (const phase of phases) {
    cosines += Math.cos(2 * Math.PI * phase);
    sines += Math.sin(2 * Math.PI * phase);
  }
  return { order: phases.length ? Math.hypot(cosines, sines) / phases.length : 0, phase: Math.atan2(sines, cosines) / (2 * Math.PI) };
}

/** Draw the distribution of T_sync. @param {CanvasPen} pen @param {Result[]} results @param {{mean: number, low: number, high: number}} found @param {Colours} colour */
function drawHistogram(pen, results, found, colour) {
  const times = results.filter((each) => each.is_synchronised).map((each) => each.cycles), most = Math.max(...times, 1);
  const width = Math.max(1, Math.ceil(most / Math.min(30, Math.max(8, Math.floor(pen.width / 16))))), bins = new Array(Math.floor(most / width) + 1).fill(0);
  for (const time of times) bins[Math.floor(time / width)] += 1;
  const axes = { x: [0, width * bins.length], y: [0, Math.max(...bins, 4) * 1.08], xLabel: "T_sync in cycles", yLabel: "trials" };
  const { placeX, placeY, low, top } = drawAxes(pen, axes, colour);
  bins.forEach((count, bin) => {
    const [from, to] = [placeX(width * bin) + 0.5, placeX(width * (bin + 1)) - 0.5];
    if (count) pen.path([[from, low], [to, low], [to, placeY(count)], [from, placeY(count)]], { fill: colour.amber, alpha: 0.85 }, true);
  });
  if (!(found.mean <= axes.x[1])) return;
  if (found.low) pen.path([[placeX(found.low), top + 3], [placeX(Math.min(found.high, axes.x[1])), top + 3]], { stroke: colour.deep, width: 3 });
  pen.path([[placeX(found.mean), top], [placeX(found.mean), low]], { stroke: colour.deep, width: 1.5, dash: 4 });
}

/** Draw T_sync against the speed: hollow points if trials are censored, crosses if all are. @param {CanvasPen} pen @param {{speed: number, mean: number, low: number, high: number, censored: number}[]} points @param {number} now @param {Colours} colour */
function drawCurve(pen, points, now, colour) {
  const speeds = points.map((each) => each.speed), known = points.filter((each) => each.mean > 0);
  const values = known.flatMap((each) => [each.mean, each.low, each.high]).filter((value) => value > 0 && Number.isFinite(value));
  const y = values.length ? [Math.min(...values) / 1.3, Math.max(...values) * 1.3] : [1, 100];
  const axes = { x: [speeds[0] / 1.15, speeds[speeds.length - 1] * 1.15], y, log: true, xLabel: "speed in cm/s", yLabel: "mean T_sync in cycles" };
  const { placeX, placeY, low, top } = drawAxes(pen, axes, colour);
  if (now >= axes.x[0] && now <= axes.x[1]) pen.path([[placeX(now), top], [placeX(now), low]], { stroke: colour.rule, width: 5 });
  points.forEach((each, number) => {
    const ends = [points[number - 1] ?? each, each].map(({ speed, mean }) => [placeX(speed), placeY(mean)]), x = placeX(each.speed);
    if (ends.flat().every(Number.isFinite)) pen.path(ends, { stroke: colour.deep, width: 1.5 });
    else if (each.censored) for (const turn of [-4, 4]) pen.path([[x - 4, top + 4 - turn], [x + 4, top + 4 + turn]], { stroke: colour.amber, width: 2 });
  });
  for (const each of known) {
    if (each.low) pen.path([each.low, each.high].map((end) => [placeX(each.speed), placeY(end)]), { stroke: colour.deep, width: 1.5 });
    pen.circle(placeX(each.speed), placeY(each.mean), 4, { fill: each.censored ? colour.box : colour.amber, stroke: colour.amber, width: 1.5 });
  }
}
