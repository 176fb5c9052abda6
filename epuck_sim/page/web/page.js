"use strict";
// The page itself: buttons, sliders and dragging, and 60 pictures a second of a swarm.

/** Longest real time for the simulation up to the next picture, ms. */
const PICTURE_MS = 14;
/** Speeds relative to real time: the stops of the slider. */
const RATES = [0.1, 0.25, 0.5, 1, 2, 5, 10, 20, 50, 100, 200, 500, 1000];
/** Periods that the raster of flashes shows. */
const RASTER_PERIODS = 12;
/** Cycles after which trials at further speeds are censored: some slow swarms would never end. */
const SWEEP_CYCLES = 2000;
/** Shortest and longest time in which the glow of a flash fades, ms; a tenth of the period in between. */
const FADES_MS = [50, 350];
/** Largest number of agents for which links are drawn. */
const MOST_LINKED = 200;
/** Most flashes a second for those who want little motion: more may harm. */
const MOST_FLASHES_A_S = 3;
/** Note on figures of trials with other settings, or another seed, than the present ones. */
const OUTDATED = " With earlier settings.";

const find = (/** @type {string} */ id) => /** @type {any} */ (document.getElementById(id));

/** Return the unpacked contents of a part of the page. @param {string} id */
async function unpack(id) {
  const packed = new Blob([fromBase64(find(id).textContent.trim())]).stream();
  return new Response(packed.pipeThrough(new DecompressionStream("gzip"))).arrayBuffer();
}

/** Show an error that keeps the page from working. @param {unknown} what */
function complain(what) {
  find("trouble").hidden = false;
  find("trouble").textContent = what instanceof Error ? what.message : `${what}`;
}

class Page {
  /** @param {any} data see writer.py @param {Modules} modules */
  constructor(data, modules) {
    this.data = data;
    this.make = swarmMaker(modules, data.facts);
    this.settings = new Map(data.settings.map((/** @type {any} */ each) => [each.key, each]));
    this.trials = new Trials(`${find("core").textContent}\nserve(self);`, modules, data.facts);
    this.results = /** @type {Done[]} */ ([]);
    this.is_playing = false;
    this.rate = 1;
    this.chosen = -1;
    this.read_address();
    this.show_settings();
    this.show_keys();
    find("counted").hidden = !data.facts.has_cycles;
    find("link").hidden = location.protocol === "about:"; // a frame in a notebook
    this.has_t_sync = data.facts.has_cycles && data.facts.order_parameter !== null;
    for (const id of ["many", "csv"]) find(id).hidden = !this.has_t_sync;
    this.listen();
    this.begin();
    this.has_phases = this.swarm.oscillators?.length !== 0; // agents always have
    for (const each of document.querySelectorAll(".of-phases")) /** @type {any} */ (each).hidden = !this.has_phases;
    if (!this.has_phases) (this.chosen = 0), this.show_one(); // there is nothing else to see
    requestAnimationFrame((now) => this.picture(now));
  }

  // --- a swarm ---------------------------------------------------------------------------------------

  /** Begin a trial with the present values and seed. */
  begin() {
    let swarm;
    try {
      swarm = this.make(this.values);
      swarm.reset(this.seed);
      find("trouble").hidden = true;
    } catch (error) {
      complain(error);
      this.play(false);
      if (this.swarm) return;
      swarm = this.make(this.data.values); // a link brought what does not fit
      swarm.reset(this.seed);
    }
    this.swarm = swarm;
    this.flashes = /** @type {number[][]} */ ([]);
    this.orders = /** @type {number[][]} */ ([]);
    this.order_gap_s = 0;
    this.links = /** @type {Map<string, number[]>} */ (new Map());
    this.glow = new Float64Array(this.swarm.count);
    this.is_touched = false;
    find("copied").textContent = this.data.given && "The command runs the same trial.";
    if (this.chosen >= this.swarm.count) this.chosen = -1;
    const refused = this.refused.splice(0).join(", ");
    this.say(refused && `Not taken from the link: ${refused}`);
    this.note_order();
    this.show_one();
    this.write_address();
  }

  /** Change values of keys, and begin anew. @param {Values} changes */
  change(changes) {
    this.values = { ...this.values, ...changes };
    this.fit();
    this.show_values();
    this.outdate();
    this.begin();
  }

  /** Make values of keys, each allowed by its own slider, fit each other. */
  fit() {
    const { values, settings } = this, k = "neighbourhood.k", most = Math.max(1, values["agents.count"] - 1);
    if (values[k] > most) values[k] = settings.get(k).stops.filter((/** @type {number} */ stop) => stop <= most).pop();
    if (values["neighbourhood.kind"] === "range") values["neighbourhood.radius_cm"] ??= this.data.facts.reach_cm;
    if (settings.has("arena.width_cm")) values["arena.height_cm"] = values["arena.width_cm"];
  }

  /** Note on figures of many trials that something has been changed since. */
  outdate() {
    this.is_outdated = true;
    for (const id of ["histogram", "curve"]) if (find(id).ariaLabel) this.caption(id, find(id).ariaLabel);
  }

  /** Simulate for some time, with a look at the order parameter ten times a period. @param {number} span_s @param {number} until */
  advance(span_s, until = Infinity) {
    const { swarm } = this, end = swarm.time_s + span_s;
    while (!swarm.has_ended && swarm.time_s < end - 1e-9 && performance.now() < until) {
      swarm.advance_to(Math.min(end, swarm.time_s + swarm.period_s / 10), (/** @type {number} */ time, /** @type {number} */ agent) => this.note_flash(time, agent));
      this.note_order();
    }
    if (swarm.has_ended) this.end();
  }

  /** @param {number} time @param {number} agent */
  note_flash(time, agent) {
    this.flashes.push([time, agent]);
    this.glow[agent] = 1;
    if (this.flashes.length > 40_000) this.flashes.splice(0, 20_000);
    if (this.swarm.receivers && this.swarm.count <= MOST_LINKED && this.links.size < 400)
      for (const other of this.swarm.receivers(agent)) this.links.set(`${agent} ${other}`, [agent, other, 1]);
  }

  note_order() {
    const { phases } = (this.seen = this.swarm.look()), { time_s } = this.swarm, /** @type {number[][]} */ orders = this.orders;
    const { metric, reference } = this.data.facts, mean = meanPhase(phases.filter((/** @type {number} */ phase) => !Number.isNaN(phase)));
    this.order = mean.order * (metric === "reference" ? Math.cos(2 * Math.PI * (mean.phase - (phases[reference] || 0))) : 1);
    if (orders.length && time_s < orders[orders.length - 1][0] + this.order_gap_s) return;
    if (orders.push([time_s, this.order]) <= 3000) return;
    this.orders = orders.filter((/** @type {number[]} */ _, /** @type {number} */ each) => each % 2 === 0);
    this.order_gap_s = (0.999 * time_s) / this.orders.length; // the beginning becomes no coarser than the end
  }

  end() {
    this.play(false);
    if (this.swarm.goes_on) return;
    const { cycles, is_synchronised } = this.swarm.finish();
    const said = !this.has_t_sync ? `Ended after ${this.swarm.time_s.toFixed(1)} s`
      : is_synchronised ? `Synchronised: T_sync is ${cycles} cycles. Play to go on` : `Not synchronised within ${cycles} cycles`;
    this.say(`${said}${this.is_touched ? ", in a trial that you have changed" : ""}`);
  }

  /** @param {string} words */
  say(words) {
    find("banner").replaceChildren(...(words ? [tag("span", words)] : []));
  }

  // --- pictures ----------------------------------------------------------------------------------------

  /** @param {number} now */
  picture(now) {
    const past = Math.min(now - (this.drawn ?? now), 100);
    this.drawn = now;
    try {
      if (this.is_playing) this.advance((past / 1000) * this.rate, performance.now() + PICTURE_MS);
      const faded = Math.exp(-past / Math.min(Math.max((100 * this.swarm.period_s) / this.rate, FADES_MS[0]), FADES_MS[1]));
      this.glow.forEach((light, agent) => (this.glow[agent] = light * faded));
      for (const [key, link] of this.links) (link[2] *= faded) < 0.05 && this.links.delete(key);
      this.draw();
    } catch (error) {
      complain(error);
      this.play(false);
    }
    requestAnimationFrame((later) => this.picture(later));
  }

  draw() {
    const { swarm, data, seen } = this, colour = colours(), threshold = data.facts.order_parameter;
    this.scale = drawArena(new CanvasPen(find("arena")), this.place(), this.shown(), colour);
    const span = RASTER_PERIODS * swarm.period_s, end = Math.max(span, swarm.time_s);
    drawOrders(new CanvasPen(find("orders")), this.orders, span, this.has_t_sync && threshold < 0.9999 ? threshold : 0, colour);
    drawPhases(new CanvasPen(find("phases")), seen.phases, colour);
    drawFlashes(new CanvasPen(find("flashes")), this.flashes, swarm.count, [end - span, end], this.chosen, colour);
    const order = this.order.toFixed(3);
    find("time").textContent = `${swarm.time_s.toFixed(1)} s`;
    find("cycles").textContent = swarm.cycles;
    find("order").textContent = order;
    find("flashes").parentElement.hidden = !this.has_phases && !this.flashes.length;
    find("orders").ariaLabel = `Order parameter ${order}`;
    if (this.chosen >= 0) this.draw_one(colour);
  }

  place() {
    const { facts } = this.data, { values, radii } = this.swarm, side = values["space.side_cm"]; // the page's may be refused
    if (!facts.swarms) return { width: side, height: side, floor: [], circles: [], polygons: [], lamps: [], radii: null };
    const { floor, circles, polygons, lamps } = facts;
    return { width: values["arena.width_cm"], height: values["arena.height_cm"], floor, circles, polygons, lamps, radii };
  }

  /** @returns {Shown} */
  shown() {
    const { swarm, seen, glow, chosen } = this, links = [...this.links.values()];
    /** @type {Shown["cones"]} */
    const cones = [], { sees, ranges_cm } = this.data.facts, { width, height } = this.place();
    if (swarm.camera) {
      for (let robot = 0; robot < swarm.count; robot++) {
        const { number } = swarm.group_of(robot);
        if (sees[number] !== "camera") continue;
        const half = ((swarm.values[`robots.${number}.camera.field_of_view_deg`] / 2) * Math.PI) / 180;
        links.push(...this.sightings(robot, half));
        if (swarm.count <= 20 || robot === chosen) cones.push({ robot, half, reach: ranges_cm[number] ?? Math.min(width, height) / 3 });
      }
    } else if (swarm.receivers && chosen >= 0) for (const other of swarm.receivers(chosen)) links.push([chosen, other, 0.8]);
    if (this.rate <= MOST_FLASHES_A_S * swarm.period_s || !matchMedia("(prefers-reduced-motion: reduce)").matches)
      return { picture: seen, glow, links: /** @type {any} */ (links), chosen, cones };
    const dark = new Float64Array(swarm.count), picture = { ...seen, phases: seen.phases.map(() => NaN), is_lit: null };
    return { picture, glow: dark, links: [], chosen, cones };
  }

  /** Return links to the robots whose rings a camera sees: lit ones in the direction of pixels that are set. @param {number} robot @param {number} half */
  sightings(robot, half) {
    const { x, y, heading, is_lit } = this.seen, pixels = this.swarm.camera(robot), { radii } = this.swarm;
    /** @type {number[][]} */
    const found = [];
    if (!pixels.some(Boolean)) return found;
    for (let other = 0; other < this.swarm.count; other++) {
      const [dx, dy] = [x[other] - x[robot], y[other] - y[robot]], far = Math.hypot(dx, dy);
      if (other === robot || !is_lit?.[other]) continue;
      const turn = Math.atan2(dy, dx) - heading[robot], angle = Math.atan2(Math.sin(turn), Math.cos(turn)), wide = Math.asin(Math.min(1, radii[other] / far));
      const [first, last] = [half - angle - wide, half - angle + wide].map((each) => Math.floor((each / (2 * half)) * pixels.length));
      if (pixels.subarray(Math.max(first, 0), Math.max(last + 1, 0)).some(Boolean)) found.push([robot, other, 0.8]);
    }
    return found;
  }

  /** @param {Colours} colour */
  draw_one(colour) {
    const { swarm, chosen } = this, phase = this.seen.phases[chosen];
    if (!swarm.camera) {
      find("facts").textContent = `Phase ${phase.toFixed(3)}; agents that its pulse would reach now: ${swarm.receivers(chosen).length}`;
      return;
    }
    const eye = find("eye") && new CanvasPen(find("eye")), pixels = swarm.camera(chosen), wide = eye?.width / pixels.length;
    pixels.forEach((/** @type {number} */ lit, /** @type {number} */ each) =>
      eye?.path([[each * wide, 0], [(each + 1) * wide, 0], [(each + 1) * wide, eye.height], [each * wide, eye.height]], { fill: lit ? colour.lit : colour.floor, stroke: colour.rule, width: 0.5 }, true));
    const bars = find("bars") && new CanvasPen(find("bars")), sensors = this.data.facts.infrared[swarm.group_of(chosen).number], step = bars?.width / sensors;
    swarm.infrared(chosen).subarray(0, sensors).forEach((/** @type {number} */ counts, /** @type {number} */ each) => {
      const high = Math.sqrt(Math.max(0, Math.min(1, counts / 3500))) * (bars.height - 18), low = bars.height - 16;
      bars.path([[each * step + 3, low], [(each + 1) * step - 3, low], [(each + 1) * step - 3, low - high], [each * step + 3, low - high]], { fill: colour.amber }, true);
      bars.text((each + 0.5) * step, bars.height - 7, `${Math.round(counts)}`, { fill: colour.faint, size: 10 });
    });
    find("facts").textContent = swarm.memory(chosen).map((/** @type {[string, number]} */ [name, value]) => `${name} ${+value.toFixed(2)}`).join(", ");
  }

  show_one() {
    const { chosen, swarm } = this, panel = find("one");
    panel.hidden = chosen < 0;
    if (chosen < 0) return;
    const push = tag("button", "Push its phase"), dark = tag("button", "");
    const name = () => (dark.textContent = `Switch its ring ${swarm.dark?.has(chosen) ? "on" : "off"}`);
    push.onclick = () => this.touch(() => swarm.push(chosen, 0.2));
    dark.onclick = () => this.touch(() => (swarm.dark.delete(chosen) || swarm.dark.add(chosen), name()));
    name();
    const facts = tag("p", "", "note"), row = tag("p", "", "row"), parts = [facts, row];
    if (swarm.camera) {
      const { number } = swarm.group_of(chosen), { sees, infrared } = this.data.facts;
      const add = (/** @type {string} */ id, /** @type {string} */ ariaLabel) =>
        parts.unshift(tag("span", ariaLabel, "note"), Object.assign(tag("canvas", ""), { id, role: "img", ariaLabel }));
      if (infrared[number]) add("bars", "Its infrared sensors, counts");
      if (sees[number].endsWith("camera")) add("eye", "Its camera's pixels, from the left");
    }
    facts.id = "facts";
    row.append(...(Number.isNaN(this.seen.phases[chosen]) ? [] : [push]), ...(swarm.dark ? [dark] : []));
    find("who").textContent = `${this.data.one[0].toUpperCase()}${this.data.one.slice(1)} ${chosen}`;
    find("known").replaceChildren(...parts);
  }

  /** Change the swarm in a way that no command can. @param {() => void} what */
  touch(what) {
    what();
    this.is_touched = true;
    find("copied").textContent = this.data.given && "The command runs this trial without what you have changed by hand.";
    this.seen = this.swarm.look();
  }

  // --- settings and the address -------------------------------------------------------------------------

  show_settings() {
    const rows = [...this.settings.values()].map((each, number) => {
      const row = tag("div", "", "slider"), id = `slider-${number}`, label = tag("label", each.label), output = tag("output", "");
      Object.assign(label, { htmlFor: id });
      if (typeof each.value === "string") {
        each.input = tag("select", "");
        each.input.append(...each.stops.map((/** @type {string} */ stop) => new Option(stop.replaceAll("_", " "), stop)));
        each.input.oninput = () => this.change({ [each.key]: each.input.value });
        row.append(label, output, each.input);
      } else {
        const track = tag("div", "", "track");
        each.input = Object.assign(tag("input", ""), { type: "range", min: 0, max: each.stops.length - 1, step: 1 });
        each.input.oninput = () => this.change({ [each.key]: each.stops[each.input.value] });
        const mark = each.stops.indexOf(each.thesis), share = mark / Math.max(each.stops.length - 1, 1);
        if (each.thesis !== null && mark >= 0) {
          const found = tag("span", "▾", "mark");
          each.input.title = `thesis: ${each.thesis} ${each.unit}`;
          found.ariaHidden = "true";
          found.style.left = `calc(${100 * share}% + ${(0.5 - share) * 16}px)`;
          track.append(found);
        }
        track.append(each.input);
        row.append(label, output, track);
      }
      each.input.id = id;
      Object.assign(each, { row, output });
      return row;
    });
    find("sliders").replaceChildren(...rows);
    this.show_values();
  }

  /** Return whether a setting exists with the present values. @param {any} setting */
  applies({ only }) {
    return !only || only[1].split(" ").includes(this.values[only[0]]);
  }

  show_values() {
    for (const each of this.settings.values()) {
      const value = this.values[each.key], said = value === null ? "unlimited" : `${number(value)} ${each.unit}`.trim();
      each.row.hidden = !this.applies(each);
      if (typeof each.value === "string") each.input.value = value;
      else {
        each.input.value = each.stops.indexOf(value);
        each.input.setAttribute("aria-valuetext", said);
        each.output.textContent = said;
      }
      each.output.className = value === each.value ? "" : "changed";
    }
    this.show_keys();
  }

  /** Return the keys that differ from the scenario's, with their values; `neighbourhood` as a whole. @returns {[string, any][]} */
  changes() {
    const changed = [...this.settings.values()].filter((each) => this.applies(each) && this.values[each.key] !== each.value);
    const rule = "neighbourhood.", [own, others] = [changed.filter((each) => each.key.startsWith(rule)), changed.filter((each) => !each.key.startsWith(rule))];
    /** @type {[string, any][]} */
    const found = others.map((each) => [each.key, this.values[each.key]]);
    if (this.values["arena.width_cm"] !== this.data.values["arena.width_cm"]) found.push(["arena.height_cm", this.values["arena.height_cm"]]);
    if (own.length) {
      const parts = [...this.settings.values()].filter((each) => each.key.startsWith(rule) && this.applies(each) && this.values[each.key] !== null);
      found.push(["neighbourhood", Object.fromEntries(parts.map((each) => [each.key.slice(rule.length), this.values[each.key]]))]);
    }
    return found;
  }

  get command() {
    const whole = (/** @type {any} */ value) => Object.entries(value).map(([key, each]) => `${key}: ${each}`).join(", ");
    const sets = this.changes().map(([key, value]) => ` --set ${value instanceof Object ? `'${key}={${whole(value)}}'` : `${key}=${value}`}`);
    return `epuck-sim run ${this.data.given}${sets.join("")}${this.values.trials > 1 ? " --trials 1" : ""} --seed ${this.seed}`;
  }

  /** Take the scenario's seed and values, and those that the address changes. */
  read_address() {
    this.seed = BigInt(this.data.seed);
    this.values = { ...this.data.values };
    this.refused = /** @type {string[]} */ ([]);
    for (const [key, text] of new URLSearchParams(location.hash.slice(1))) {
      const setting = this.settings.get(key), value = setting?.stops.find((/** @type {any} */ stop) => `${stop}` === text);
      if (key === "seed" && /^\d{1,40}$/.test(text)) this.seed = BigInt(text);
      else if (value !== undefined) this.values[key] = value;
      else this.refused.push(`${key}=${text}`);
    }
    this.fit();
  }

  /** Seed and changed values, for a link to the page. */
  get hash() {
    const changed = [...this.settings.values()].filter((each) => this.values[each.key] !== each.value).map((each) => [each.key, `${this.values[each.key]}`]);
    return `#${new URLSearchParams([["seed", `${this.seed}`], ...changed])}`;
  }

  write_address() {
    try {
      history.replaceState(null, "", this.hash);
    } catch {
      // a frame in a notebook has no address; and browsers refuse hundreds of changes in a few seconds
    }
    find("seed").value = `${this.seed}`;
    find("command-is").textContent = this.command;
  }

  show_keys() {
    const wanted = find("find").value.toLowerCase(), rows = Object.entries(this.values).filter(([key, value]) => this.applies(this.settings.get(key) ?? {}) && `${key} ${value}`.toLowerCase().includes(wanted));
    find("rows").replaceChildren(...rows.map(([key, value]) => {
      const row = tag("tr", ""), name = tag("td", ""), cell = tag("td", value === null ? "null" : typeof value === "object" ? JSON.stringify(value) : `${value}`);
      name.append(tag("code", ""));
      name.firstChild.append(...key.split(/(?<=[._])/).flatMap((part) => [part, tag("wbr", "")])); // lines break there alone
      cell.className = value === this.data.values[key] ? "" : "changed";
      row.append(name, cell);
      return row;
    }));
  }

  // --- many trials ---------------------------------------------------------------------------------------

  /** Run `count` trials with the values of each point. @param {Values[]} points @param {number} count @param {(results: Result[][]) => void} show */
  async run(points, count, show) {
    const results = points.map(() => /** @type {Result[]} */ ([])), progress = find("progress");
    let shown = 0;
    const busy = (/** @type {boolean} */ is) => {
      const is_held = document.activeElement?.matches("#hundred, #sweep, #stop");
      Object.entries({ hundred: is, stop: !is, progress: !is, sweep: is || !this.data.speed }).forEach(([id, hidden]) => (find(id).hidden = hidden));
      find("many").ariaBusy = `${is}`;
      if (is_held) find(is ? "stop" : "hundred").focus();
    };
    busy(true);
    this.play(false);
    this.results = [];
    this.is_outdated = false;
    find("summary").hidden = true;
    try {
      await this.trials.run(points, count, this.seed, (done) => {
        results[done.task.point].push(done.result);
        this.results.push(done);
        find("csv").disabled = false;
        progress.value = this.results.length / (points.length * count);
        if (performance.now() - shown > 80) [shown] = [performance.now()], show(results);
      }, () => {
        find("summary").hidden = false;
        find("summary").textContent = "This browser allows the page no workers: trials run in the page itself, a little at a time.";
      });
      show(results);
    } catch (error) {
      find("summary").hidden = true;
      complain(error);
    } finally {
      busy(false);
    }
  }

  /** Show a figure with a caption. @param {string} id @param {string} said */
  caption(id, said) {
    const figure = find(id).parentElement;
    figure.hidden = false;
    figure.querySelector("figcaption").textContent = said + (this.is_outdated ? OUTDATED : "");
    find(id).ariaLabel = said;
  }

  async hundred() {
    const { values } = this;
    await this.run([values], 100, ([results]) => {
      const found = estimate(results, values["stop.max_cycles"], this.data.student), censored = countCensored(results);
      const interval = found.low ? ` (95 % interval ${rounded(found.low)} to ${rounded(found.high)})` : "";
      const said = `${results.length} trial${results.length === 1 ? "" : "s"}: ${censored ? "restricted " : ""}mean T_sync ${found.mean ? `${rounded(found.mean)} cycles${interval}` : "not known"}, ${censored} censored.`;
      this.caption("histogram", said);
      this.redraw = () => drawHistogram(new CanvasPen(find("histogram")), results, found, colours());
      this.redraw();
    });
  }

  async sweep() {
    const { key, stops } = this.data.speed, limit = Math.min(this.values["stop.max_cycles"], SWEEP_CYCLES), { max_time_s } = this.data.facts;
    const points = stops.map((/** @type {number} */ speed) => ({ ...this.values, [key]: speed, "stop.max_cycles": limit }));
    await this.run(points, 30, (results) => {
      const curve = stops.map((/** @type {number} */ speed, /** @type {number} */ each) => ({ speed, censored: countCensored(results[each]), ...estimate(results[each], limit, this.data.student) }));
      this.caption("curve", `${this.results.length} of ${30 * stops.length} trials, 30 at each speed, censored after ${limit} cycles${max_time_s === null ? "" : ` or ${max_time_s} s`}; bars are 95 % intervals. Hollow: some are censored, and the mean is restricted to that limit; crosses: all are. Grey band: the present speed.`);
      this.recurve = () => drawCurve(new CanvasPen(find("curve")), curve, this.values[key], colours());
      this.recurve();
      const table = curve.map((/** @type {any} */ each) => `<tr><td>${each.speed}</td><td>${each.mean ? rounded(each.mean) : "–"}</td><td>${each.low ? `${rounded(each.low)} to ${rounded(each.high)}` : "–"}</td><td>${each.censored}</td></tr>`);
      find("table").innerHTML = `<table><thead><tr><th scope="col">cm/s</th><th scope="col">mean T_sync, cycles</th><th scope="col">95 % interval</th><th scope="col">censored</th></tr></thead><tbody>${table.join("")}</tbody></table>`;
      find("table").hidden = false;
    });
  }

  // --- buttons, keys and fingers ---------------------------------------------------------------------------

  /** @param {boolean} is_playing */
  play(is_playing) {
    this.is_playing = is_playing;
    find("play").querySelector(".word").textContent = is_playing ? "Pause" : "Play";
    find("play").querySelector("span").textContent = is_playing ? "❚❚" : "▶";
  }

  toggle() {
    this.go_on();
    if (this.swarm.has_ended) this.begin();
    this.play(!this.is_playing);
  }

  /** Let a trial that has ended at T_sync go on. */
  go_on() {
    const { has_ended, is_synchronised, goes_on } = this.swarm;
    if (has_ended && is_synchronised && !goes_on) this.swarm.go_on();
  }

  step() {
    this.go_on();
    this.play(false);
    this.advance(this.swarm.step_s ?? this.swarm.period_s / 20);
  }

  /** @param {bigint} seed */
  take_seed(seed) {
    this.seed = seed;
    this.outdate();
    this.begin();
  }

  listen() {
    const rate = find("rate"), set = () => {
      this.rate = RATES[rate.value];
      find("rate-is").textContent = `× ${this.rate}`;
      rate.setAttribute("aria-valuetext", `${this.rate} times real time`);
    };
    Object.assign(rate, { max: RATES.length - 1, value: RATES.indexOf(this.data.facts.swarms ? 5 : 1), oninput: set });
    set();
    /** @type {{[id: string]: () => void}} */
    const pressed = {
      play: () => this.toggle(), step: () => this.step(), again: () => this.begin(), next: () => this.take_seed(this.seed + 1n),
      defaults: () => this.change({ ...this.data.values }), hundred: () => this.hundred(), sweep: () => this.sweep(), stop: () => this.trials.stop(),
      link: () => this.copy(location.href.split("#")[0] + this.hash, location.protocol === "file:" ? "The link, which works only on this computer," : "The link"), command: () => this.copy(this.command, "The command"),
      yaml: () => save("scenario.yaml", toYaml(this.nested())), csv: () => save("trials.csv", this.csv()), svg: () => save("swarm.svg", this.svg()),
    };
    for (const [id, what] of Object.entries(pressed)) find(id).onclick = what;
    find("find").oninput = () => this.show_keys();
    find("seed").onchange = () => {
      const value = find("seed").value.trim(), is_seed = /^\d{1,40}$/.test(value);
      if (is_seed) return this.take_seed(BigInt(value));
      this.say(`A seed cannot be ${value || "empty"}: give 1 to 40 digits`);
      find("seed").value = `${this.seed}`;
    };
    document.addEventListener("keydown", (event) => {
      const { target, key } = event, id = { " ": "play", ".": "step", r: "again", n: "next" }[key.toLowerCase()];
      const taken = `select, [type=text], [type=search]${id === "play" ? ", button" : ""}`;
      if (!id || event.ctrlKey || event.metaKey || event.altKey || /** @type {Element} */ (target).matches(taken)) return;
      event.preventDefault();
      pressed[id]();
    });
    const again = () => [this.redraw, this.recurve].forEach((draw) => draw?.());
    window.addEventListener("resize", again);
    window.addEventListener("error", ({ error, message }) => (complain(error ?? message), this.play(false)));
    window.addEventListener("hashchange", () => {
      this.read_address();
      this.change({});
    });
    matchMedia("(prefers-color-scheme: dark)").addEventListener("change", again);
    this.listen_to_arena(find("arena"));
  }

  /** @param {HTMLCanvasElement} arena */
  listen_to_arena(arena) {
    let held = -1;
    const at = (/** @type {PointerEvent} */ event) => {
      const box = arena.getBoundingClientRect(), { left, low, scale } = this.scale;
      return [(event.clientX - box.left - left) / scale, (low - (event.clientY - box.top)) / scale];
    };
    const under = (/** @type {PointerEvent} */ event) => {
      const [x, y] = at(event), picture = this.seen, far = [...picture.x].map((each, agent) => Math.hypot(each - x, picture.y[agent] - y));
      const nearest = far.indexOf(Math.min(...far));
      return far[nearest] * this.scale.scale <= Math.max(this.scale.size + 4, event.pointerType === "touch" ? 22 : 8) ? nearest : -1;
    };
    const choose = (/** @type {number} */ agent) => ((this.chosen = agent), this.show_one());
    arena.addEventListener("pointerdown", (event) => {
      held = under(event);
      choose(held);
      if (held < 0) return;
      arena.setPointerCapture(event.pointerId);
      arena.classList.add("drags");
    });
    arena.addEventListener("touchstart", (event) => held >= 0 && event.preventDefault(), { passive: false });
    arena.addEventListener("pointermove", (event) => {
      const [x, y] = at(event);
      if (held >= 0 && event.buttons && Math.hypot(x - this.seen.x[held], y - this.seen.y[held]) * this.scale.scale > 3) this.touch(() => this.swarm.put(held, x, y));
    });
    for (const kind of ["pointerup", "pointercancel"]) arena.addEventListener(kind, () => ((held = -1), arena.classList.remove("drags")));
    arena.addEventListener("keydown", ({ key }) => {
      const by = { ArrowRight: 1, ArrowLeft: -1 }[key], { count } = this.swarm;
      if (by) choose((this.chosen + by + count + (this.chosen < 0 && by < 0 ? 1 : 0)) % count);
      if (key === "Escape") choose(-1);
    });
  }

  // --- links, commands and files -----------------------------------------------------------------------------

  /** @param {string} text @param {string} what */
  async copy(text, what) {
    try {
      await navigator.clipboard.writeText(text);
    } catch {
      const area = Object.assign(tag("textarea", text), { value: text });
      document.body.append(area);
      area.select();
      const is_done = document.execCommand("copy");
      area.remove();
      if (!is_done) return (find("copied").textContent = `This browser lets the page copy nothing; copy it from here: ${text}`);
    }
    find("copied").textContent = `${what} is copied.`;
  }

  /** Return the present scenario in the form that the program reads. */
  nested() {
    const found = structuredClone(this.data.nested);
    for (const [key, value] of this.changes()) {
      const parts = key.split("."), last = /** @type {string} */ (parts.pop());
      parts.reduce((/** @type {any} */ inner, part) => inner[part], found)[last] = value;
    }
    return { ...found, seed: this.seed };
  }

  csv() {
    const moved = [...this.settings.values()].filter(({ key, value }) => key !== this.data.speed?.key && this.results.some(({ task }) => task.values[key] !== value)).map(({ key }) => key);
    const heads = ["speed_cm_s", "trial", "seed", "t_sync_cycles", "censored", "cycles", "order_parameter", "steps", "simulated_s", ...moved];
    const rows = this.results.map(({ task, result }) => {
      const { seed, cycles, is_synchronised, order_parameter, steps, time_s } = result, t_sync = is_synchronised ? cycles : "";
      return [task.values[this.data.speed?.key] ?? "", task.trial, seed, t_sync, is_synchronised ? 0 : 1, cycles, order_parameter ?? "", steps, time_s, ...moved.map((key) => task.values[key] ?? "")];
    });
    return [heads, ...rows].map((row) => `${row.join(",")}\n`).join("");
  }

  svg() {
    const pen = new SvgPen(800, 800);
    drawArena(pen, this.place(), this.shown(), colours());
    return pen.svg;
  }
}

/** @param {string} name @param {string} text @param {string} kind of class @returns {any} */
function tag(name, text, kind = "") {
  return Object.assign(document.createElement(name), { textContent: text, className: kind });
}

/** @param {Result[]} results */
function countCensored(results) {
  return results.filter((each) => !each.is_synchronised).length;
}

/** Make the browser save a file. @param {string} name @param {string} text */
function save(name, text) {
  const link = Object.assign(document.createElement("a"), { download: name, href: URL.createObjectURL(new Blob([text])) });
  link.click();
  setTimeout(() => URL.revokeObjectURL(link.href), 1000);
}

/** Return a value as YAML: a line for each key; values that are no mappings are JSON, which is YAML, too. @param {any} value @param {string} indent @returns {string} */
function toYaml(value, indent = "") {
  return Object.entries(value).map(([key, each]) => {
    if (each && typeof each === "object" && !Array.isArray(each) && Object.keys(each).length) return `${indent}${key}:\n${toYaml(each, `${indent}  `)}`;
    return `${indent}${JSON.stringify(key)}: ${typeof each === "bigint" ? each : JSON.stringify(each)}\n`;
  }).join("");
}

(async () => {
  try {
    if (typeof WebAssembly === "undefined" || typeof DecompressionStream === "undefined") throw new Error("This browser does not run WebAssembly; any of the last three years does.");
    const data = JSON.parse(new TextDecoder().decode(await unpack("data")));
    const own = find("own").textContent.trim() ? await WebAssembly.compile(await unpack("own")) : null;
    /** @type {any} */ (globalThis).page = new Page(data, [await WebAssembly.compile(await unpack("wasm")), own]);
    document.documentElement.dataset.ready = "yes";
  } catch (error) {
    complain(error);
  }
})();
