"use strict";
// A swarm of point agents: the rules of a scenario in a block of memory, its trials, and the picture that a page shows.

/** A number larger than any count, and than any cycle's number. */
const UNLIMITED = 2 ** 62;

/** Pulses after which a trial that runs in slices lets others have their turn. */
const SLICE_PULSES = 50_000;

/** Return the fields of a scene that depend on values of keys, as `neighbourhood_of` and `_scene_values` do. */
/** @param {any} facts @param {Values} values @returns {{[name: string]: number}} */
function agentsScene(facts, values) {
  const agents = values["agents.count"], side = values["space.side_cm"], period = values["clocks.period_s"];
  const { dimensions, kinds, is_cyclic, reorients, unlimited_cm } = facts;
  const rule = values["neighbourhood.kind"];
  let kind = kinds.nearest, k = agents - 1, radius = unlimited_cm, angle = 360;
  if (rule === "nearest" || rule === "random") [kind, k] = [kinds[rule], Math.min(values["neighbourhood.k"], agents - 1)];
  else if (rule !== "all") {
    kind = rule === "cone_of_vision" ? kinds.vision : kinds.emission;
    radius = values["neighbourhood.radius_cm"] ?? unlimited_cm;
    if (rule !== "range") angle = values["neighbourhood.angle_deg"];
  } else kind = kinds.emission;
  const row = kind === kinds.nearest ? Math.max(k, 1) : agents, isCone = angle < 360, [, [cos, sin]] = facts.angles.find((/** @type {any[]} */ each) => each[0] === angle);
  const spacing = side / agents ** (1 / dimensions);
  const cell = kind === kinds.nearest ? spacing : Math.max(spacing, radius / 2);
  const expected = k + 1 + 3 * Math.sqrt(k + 1);
  const reach = spacing * (expected / facts.ball_volume) ** (1 / dimensions);
  const search = kind === kinds.nearest ? reach : radius + cell / 4;
  const share = ((2 * search + 2 * cell) / side) ** dimensions;
  const isLocal = kind !== kinds.random && share < (kind === kinds.nearest ? facts.max_share_nearest : facts.max_share);
  const cells = agents >= facts.min_cell_list && isLocal ? Math.max(1, Math.floor(side / cell)) : 0;
  const jumps = isCone && (is_cyclic || reorients);
  const threshold = agents === 1 || facts.order_parameter === null ? Infinity : facts.order_parameter;
  return {
    agents, kind, k, cos, sin, cells, threshold,
    side_cm: side,
    radius_cm: radius,
    row,
    is_cached: agents * row <= facts.max_cached && !jumps && kind !== kinds.random ? 1 : 0,
    search_radius_cm: search,
    cell_cm: side / Math.max(cells, 1),
    run: facts.run_s / period,
    "response.coupling": values["response.coupling"],
    "response.refractory": values["response.refractory"],
    sends_every_pulse: facts.sends_every_pulse || kind === kinds.random ? 1 : 0,
    max_offset: facts.max_time_s !== null ? 1 : threshold < Infinity ? maxOffset(agents, threshold) : -1,
  };
}

/** Return the largest distance, in cycles, of a phase from the reference's if the order parameter reaches a threshold. */
/** @param {number} agents @param {number} threshold */
function maxOffset(agents, threshold) {
  const cosine = 1 - (agents * (1 - threshold + 1e-12)) / 2;
  return cosine > -1 && cosine < 1 ? Math.acos(cosine) / Math.PI : 1;
}

/** A swarm of point agents with the values of some keys. */
class Agents {
  /** @param {Modules} modules @param {any} facts see agents.py @param {Values} values */
  constructor(modules, facts, values) {
    const kernels = (this.kernels = new Kernels(modules)), scene = agentsScene(facts, values);
    this.facts = facts;
    this.values = values;
    this.seeds = new Seeds(kernels);
    this.count = scene.agents;
    this.period_s = this.values["clocks.period_s"];
    this.max_cycles = this.values["stop.max_cycles"];
    const sizes = {
      ...facts.sizes,
      agents: this.count,
      rows: facts.dimensions * this.count,
      events: this.count + 1,
      blocks: Math.ceil(this.count / facts.branches),
      cell_starts: scene.cells ? scene.cells ** facts.dimensions + 1 : 0,
      members: scene.row * (scene.is_cached ? this.count : 1),
    };
    /** @type {{[name: string]: [first: number, end: number]}} */
    this.at = {};
    let size = facts.scene_bytes;
    for (const [name, bytes, length] of facts.arrays) {
      this.at[name] = [size, size + bytes * sizes[length]];
      size = Math.ceil(this.at[name][1] / 8) * 8;
    }
    const block = (this.block = new Block(kernels, size));
    block.bytes.set(facts.scene_base);
    const at = new BigInt64Array(kernels.memory.buffer, block.first, 2 * facts.arrays.length);
    at.set(facts.arrays.flatMap((/** @type {[string]} */ [name]) => this.at[name].map(BigInt)));
    for (const [name, value] of Object.entries(scene)) this.set(name, value);
    for (const [name, value] of Object.entries(facts.fill)) this.fill(name, Number(value));
    this.array("candidates", Uint32Array).set(Array.from({ length: this.count }, (_, agent) => agent));
    this.fill("speed", this.values["agents.speed_cm_s"] * this.period_s);
    for (const [name, numbers] of Object.entries(facts.given)) this.array(name, Float64Array).set(numbers);
    this.array("curve", Uint8Array).set(fromBase64(facts.curve));
    if (facts.curve) this.block.floats(this.at.curve[0], 1)[0] = this.values["response.coupling"];
    this.give();
    this.beginning = block.bytes.slice(0, this.at.members[0]);
    this.addresses = kernels.take(8 * facts.calls.length);
    this.write_addresses(scene);
    this.swarm = [...Kernels.array(block.first, size, 1), ...Kernels.array(this.addresses, facts.calls.length, 8)];
  }

  /** Write phases that the scenario gives for any number of agents. */
  give() {
    if (!this.facts.is_synchronised) return;
    const phases = this.array("phases_now", Float64Array);
    phases.fill(0);
    phases[0] = this.facts.displacement;
    this.array("next_firing", Float64Array).set(phases.map((/** @type {number} */ phase) => 1 - phase));
  }

  /** Write the addresses of the functions that are called. */
  /** @param {{[name: string]: number}} scene */
  write_addresses(scene) {
    const { kernels, facts } = this, { nearest, random } = facts.kinds;
    let search = scene.kind === nearest ? "search_nearest" : scene.kind === random ? "draw_receivers" : "search_cone";
    if (scene.cells) search = "search_cells";
    const names = { ...facts.functions, SEARCH: search };
    const addresses = facts.calls.map((/** @type {string} */ call) => BigInt(names[call] ? kernels.address(names[call]) : 0));
    new BigInt64Array(kernels.memory.buffer, this.addresses, addresses.length).set(addresses);
    this.search = search;
  }

  /** @param {string} name of a field of the scene */
  get(name) {
    const [offset, kind] = this.facts.scene[name];
    return this.block.read(offset, kind);
  }

  /** @param {string} name @param {number} value */
  set(name, value) {
    const [offset, kind] = this.facts.scene[name];
    this.block.write(offset, kind, value);
  }

  /** @param {string} name of an array @param {any} Kind of typed array @returns {any} */
  array(name, Kind) {
    const [first, end] = this.at[name];
    return new Kind(this.kernels.memory.buffer, this.block.first + first, (end - first) / Kind.BYTES_PER_ELEMENT);
  }

  /** @param {string} name @param {number} value */
  fill(name, value) {
    const { 1: bytes } = this.facts.arrays.find((/** @type {any[]} */ each) => each[0] === name);
    this.array(name, bytes === 1 ? Uint8Array : Float64Array).fill(value);
  }

  /** Begin the trial with a seed. @param {bigint} seed */
  reset(seed) {
    this.seed = seed;
    this.block.bytes.set(this.beginning);
    this.kernels.call("start", ...this.swarm, ...this.seeds.words(seed));
    const { max_time_s } = this.facts, { max_cycles } = this, longest = 2 * max_cycles * this.period_s;
    this.end_s = Math.min(longest, max_time_s ?? Infinity);
    this.is_timed = this.end_s === max_time_s;
    this.end = this.is_timed ? this.moment(this.end_s) : [2 * max_cycles, 0];
    this.has_ended = this.goes_on = false;
  }

  /** Simulate beyond synchrony. */
  go_on() {
    this.goes_on = true;
    this.has_ended = false;
  }

  /** Return the period, and the share of it, of a time. @param {number} time_s @returns {[number, number]} */
  moment(time_s) {
    const periods = time_s / this.period_s, share = periods % 1; // exact, as Python's divmod is
    return [Math.round(periods - share), share];
  }

  /** Simulate until a limit. @param {number[]} end @param {number} pulses @param {number} offset */
  advance(end, pulses, offset) {
    this.set("limits.pulses", pulses);
    this.set("limits.cycles", this.max_cycles);
    this.set("limits.last_cycle", end[0]);
    this.set("limits.last_time", end[1]);
    this.set("limits.max_offset", Math.max(offset, this.get("max_offset")));
    this.kernels.call("advance", ...this.swarm);
  }

  get time_s() {
    return (this.get("cycle") + this.get("now")) * this.period_s;
  }

  get cycles() {
    return this.get("cycles");
  }

  get is_synchronised() {
    return this.get("is_synchronised") === 1;
  }

  /** Return whether no agent fires any more before the limit of time. */
  is_past_end() {
    let next = Infinity;
    for (const time of this.array("next_firing", Float64Array)) next = Math.min(next, time);
    const share = next - Math.floor(next), period = this.get("cycle") + Math.floor(next);
    return period > this.end[0] || (period === this.end[0] && share > this.end[1]);
  }

  /** Run the present trial to its end, in slices; each step yields the cycles so far. @returns {Generator<number, Result>} */
  *run() {
    while (!(this.is_synchronised || this.cycles >= this.max_cycles || this.is_past_end())) {
      this.advance(this.end, this.get("pulses") + SLICE_PULSES, -1);
      yield this.cycles;
    }
    return this.finish();
  }

  /** Return how the trial has ended. @returns {Result} */
  finish() {
    const isEarly = this.is_synchronised || this.cycles >= this.max_cycles;
    if (this.is_timed && !isEarly) this.move_to(this.end_s);
    const order = this.get("order_parameter"), hasOrder = isEarly || this.is_timed;
    return {
      seed: this.seed,
      cycles: this.cycles,
      is_synchronised: this.is_synchronised,
      order_parameter: hasOrder && !Number.isNaN(order) ? order : null,
      steps: this.get("instants"),
      time_s: hasOrder ? this.time_s : this.end_s,
    };
  }

  /** @param {number} time_s */
  move_to(time_s) {
    const end = this.moment(time_s);
    this.advance(end, UNLIMITED, 1);
    if (!this.is_synchronised) this.set("now", end[0] - this.get("cycle") + end[1]);
  }

  /** Simulate up to a time, or to the end of the trial; call `tell` at each flash. */
  /** @param {number} time_s @param {(time_s: number, agent: number) => void} tell */
  advance_to(time_s, tell) {
    const to = Math.min(time_s, this.end_s), end = this.moment(to);
    while (!this.has_ended) {
      const before = this.get("instants");
      this.advance(end, this.get("pulses") + 1, 1);
      if (this.get("instants") === before) {
        this.set("now", end[0] - this.get("cycle") + end[1]);
        this.has_ended = to === this.end_s;
        return;
      }
      for (const agent of this.array("fired", Uint32Array).subarray(0, this.get("fired"))) tell(this.time_s, agent);
      this.has_ended = (this.is_synchronised && !this.goes_on) || this.cycles >= this.max_cycles;
    }
  }

  /** Return the picture of this moment. @returns {Picture} */
  look() {
    this.kernels.call("observe", ...this.swarm);
    const { count } = this, { dimensions } = this.facts, places = this.array("positions_now", Float64Array);
    const headings = this.array("heading", Float64Array), phases = this.array("phases_now", Float64Array);
    const x = places.slice(0, count), middle = this.values["space.side_cm"] / 2;
    const y = dimensions > 1 ? places.slice(count, 2 * count) : new Float64Array(count).fill(middle);
    const heading = new Float64Array(count);
    for (let agent = 0; agent < count; agent++) heading[agent] = Math.atan2(dimensions > 1 ? headings[count + agent] : 0, headings[agent]);
    return { x, y, heading, phases: phases.slice(), is_lit: null };
  }

  /** Return the agents that would receive a pulse of an agent now; none if receivers are drawn at each pulse. @param {number} agent */
  receivers(agent) {
    if (this.search === "draw_receivers") return new Uint32Array(0);
    const kept = this.block.bytes.slice();
    const keep = this.get("now");
    this.kernels.call(this.search, ...this.swarm, BigInt(agent), keep);
    const row = this.get("is_cached") ? agent * this.get("row") : 0, found = Number(this.array("counts", BigInt64Array)[agent]);
    const receivers = this.array("members", Uint32Array).slice(row, row + found);
    this.block.bytes.set(kept);
    return receivers;
  }

  /** Put an agent elsewhere. @param {number} agent @param {number} x @param {number} y */
  put(agent, x, y) {
    this.look();
    const { count } = this, side = this.values["space.side_cm"], origin = this.array("origin", Float64Array);
    const now = [this.get("cycle"), this.get("now")];
    origin.set(this.array("positions_now", Float64Array));
    [x, y].slice(0, this.facts.dimensions).forEach((place, axis) => (origin[axis * count + agent] = Math.min(Math.max(place, 0), side)));
    this.array("start_cycle", Float64Array).fill(now[0]);
    this.array("start_time", Float64Array).fill(now[1]);
    this.kernels.call("begin_motion", ...this.swarm.slice(0, 7));
    this.forget();
  }

  /** Shift the phase of an agent, up to that at which it fires. @param {number} agent @param {number} cycles */
  push(agent, cycles) {
    const firings = this.array("next_firing", Float64Array), forward = cycles * this.array("period", Float64Array)[agent];
    firings[agent] = Math.max(firings[agent] - forward, this.get("now"));
    this.fill("block_earliest", -Infinity);
  }

  /** Make kernels search for neighbours anew. */
  forget() {
    this.array("cached_until", Float64Array).fill(-Infinity);
    this.set("positions_time", NaN);
    this.set("sorted_at", -Infinity);
  }
}
