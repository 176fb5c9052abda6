"use strict";
// A swarm of robots: a block that the program has made, bodies in Chipmunk, trials, and the picture that a page shows.

/** What `take_steps` returns when the reference fires. */
const FIRED = -2;

/** Most control steps in one call of a trial that runs in slices. */
const UNSEEN_STEPS = 50;

/** Number of such calls after which a trial lets others have their turn. */
const SLICE = 20;

/** @param {string} text in base 64 */
function fromBase64(text) {
  return Uint8Array.from(atob(text), (letter) => letter.charCodeAt(0));
}

/** A swarm of robots with the values of some keys. */
class Robots {
  /** @param {Modules} modules @param {any} facts see robots.py @param {Values} values */
  constructor(modules, facts, values) {
    const kernels = (this.kernels = new Kernels(modules));
    this.facts = facts;
    this.values = values;
    this.max_cycles = values["stop.max_cycles"];
    this.seeds = new Seeds(kernels);
    const own = (this.own = facts.swarms[values["robots.0.count"]]), bytes = fromBase64(own.block);
    this.block = new Block(kernels, bytes.length);
    this.block.bytes.set(bytes);
    const [first] = facts.scene.at;
    this.at = [...new BigInt64Array(bytes.buffer, first, facts.arrays.length + 1)].map(Number);
    this.count = (this.place_of("groups") - this.place_of("robots")) / facts.bytes.robot;
    this.groups = facts.placements.map((/** @type {string} */ _, /** @type {number} */ number) => {
      const get = (/** @type {string} */ name) => this.get("group", name, number);
      return { first: get("first"), count: get("count"), memory: get("memory"), size: get("memory_bytes"), pixels: get("pixels"), row: get("row") };
    });
    /** Radii of bodies, cm. */
    this.radii = Float64Array.from({ length: this.count }, (_, robot) => this.get("robot", "radius_cm", robot));
    this.set_parameters();
    this.set_size();
    this.set_view();
    this.beginning = this.block.bytes.slice();
    this.make_world(own.functions);
    this.scratch = Kernels.array(kernels.take(80), 10, 8);
    this.step_s = facts.step_ms / 1000;
    this.set_watch();
  }

  /** Return where an array of the block begins. @param {string} name */
  place_of(name) {
    return this.at[this.facts.arrays.indexOf(name)];
  }

  /** Return where a record begins. @param {string} record @param {number} number */
  record(record, number) {
    if (record === "scene") return 0;
    return this.place_of(`${record}s`) + number * this.facts.bytes[record];
  }

  /** @param {string} record scene, robot or group @param {string} name @param {number} number */
  get(record, name, number = 0) {
    const [offset, kind] = this.facts[record][name];
    return this.block.read(this.record(record, number) + offset, kind);
  }

  /** @param {string} record @param {string} name @param {number} number @param {number} value */
  set(record, name, number, value) {
    const [offset, kind] = this.facts[record][name];
    this.block.write(this.record(record, number) + offset, kind, value);
  }

  set_parameters() {
    const first = this.get("group", "parameters");
    for (const [name, [offset, kind]] of Object.entries(this.facts.parameters[0])) {
      const value = this.values[`robots.0.parameters.${name}`];
      if (value !== undefined) this.block.write(first + offset, kind, value);
    }
  }

  /** Set the size of the arena, and with it the cells, as `set_cells` does. */
  set_size() {
    const width = this.values["arena.width_cm"], height = this.values["arena.height_cm"], { cell_cm } = this.facts;
    const side = Math.max(cell_cm, Math.sqrt((width * height) / this.count));
    const columns = Math.max(1, Math.floor(width / side)), rows = Math.max(1, Math.floor(height / side));
    const found = { width_cm: width, height_cm: height, columns, rows, cell_width_cm: width / columns, cell_height_cm: height / rows };
    for (const [name, value] of Object.entries(found)) this.set("scene", name, 0, value);
  }

  /** Set the camera of the first group. */
  set_view() {
    const wanted = this.values["robots.0.camera.field_of_view_deg"];
    const view = this.facts.views.find((/** @type {any[]} */ each) => each[0] === wanted)?.[1];
    if (!view || this.facts.sees[0] !== "camera") return;
    for (const [name, value] of Object.entries(view.camera)) this.set("group", `camera.${name}`, 0, Number(value));
    this.block.floats(this.place_of("rays"), view.rays.length).set(view.rays);
  }

  /** Make bodies and surfaces, and write the addresses of all that is called. @param {{[index: string]: string}} functions */
  make_world(functions) {
    const { kernels, facts } = this, call = kernels.functions, { friction, margin_cm: margin } = facts;
    const surfaces = this.get("scene", "surfaces"), listed = Object.keys(functions).map(Number);
    const length = Math.max(...listed, surfaces + this.get("scene", "surface_count")) + 1;
    const first = kernels.take(8 * length);
    const addresses = new Array(length).fill(0), ground = (addresses[1] = call.make_ground());
    facts.functions.forEach((/** @type {string} */ name, /** @type {number} */ index) => {
      addresses[facts.head + index] = kernels.address(call[`call_${name}`] ? `call_${name}` : name);
    });
    for (const [index, name] of Object.entries(functions)) addresses[Number(index)] = kernels.address(name);
    for (let robot = 0, place = this.get("scene", "bodies"); robot < this.count; robot++, place += 2) {
      addresses[place] = call.make_body(facts.masses[this.group_of(robot).number], this.radii[robot]);
      addresses[place + 1] = call.make_disc(addresses[place], 0, 0, this.radii[robot] + margin, friction);
      if (!facts.touch) call.pass_through(addresses[place + 1], 1);
    }
    this.make_surfaces(ground, margin).forEach((shape, index) => (addresses[surfaces + index] = shape));
    new BigInt64Array(kernels.memory.buffer, first, length).set(addresses.map(BigInt));
    this.swarm = [...Kernels.array(this.block.first, this.block.size, 1), ...Kernels.array(first, length, 8)];
  }

  /** Return the shapes of walls and obstacles, in the program's order. @param {number} ground @param {number} margin */
  make_surfaces(ground, margin) {
    const { kernels, facts } = this, { friction, wall_cm: out } = facts;
    const width = this.values["arena.width_cm"], height = this.values["arena.height_cm"];
    const slabs = [[-out, -out, 0, height + out], [width, -out, width + out, height + out], [-out, -out, width + out, 0], [-out, height, width + out, height + out]];
    const polygon = (/** @type {number[][]} */ corners) => {
      const at = kernels.take(16 * corners.length);
      new Float64Array(kernels.memory.buffer, at, 2 * corners.length).set(corners.flat());
      return kernels.functions.make_polygon(ground, corners.length, at, margin, friction);
    };
    return [
      ...slabs.map(([left, low, right, high]) => polygon([[left, low], [right, low], [right, high], [left, high]])),
      ...facts.circles.map((/** @type {number[]} */ [x, y, radius]) => kernels.functions.make_disc(ground, x, y, radius + margin, friction)),
      ...facts.polygons.map(polygon),
    ];
  }

  /** Find the oscillators, and the limits at which a trial ends, as `SynchronyWatch` does. */
  set_watch() {
    const { facts } = this, { step_ms } = facts;
    /** For each oscillator, the place and kind of its phase in the block, and its period in ms. @type {{robot: number, at: number, kind: string, period: number}[]} */
    this.oscillators = [];
    this.groups.forEach((/** @type {any} */ group, /** @type {number} */ number) => {
      const [phase, period] = [facts.memories[number].phase_ms, facts.parameters[number].period_s];
      if (!phase || !period || this.get("group", "phase", number) < 0) return;
      const length = this.block.read(this.get("group", "parameters", number) + period[0], period[1]) * 1000;
      for (let member = 0; member < group.count; member++)
        this.oscillators.push({ robot: group.first + member, at: group.memory + member * group.size + phase[0], kind: phase[1], period: length });
    });
    this.sums = this.kernels.take(16 + 8 * this.oscillators.length);
    const reference = (this.reference = this.oscillators.find((each) => each.robot === facts.reference));
    this.measures = reference !== undefined;
    const period = reference ? reference.period : facts.nominal_period_ms;
    this.steps_a_cycle = facts.nominal_period_ms / step_ms;
    this.max_steps = Math.ceil(2 * this.max_cycles * (period / step_ms + 1));
    if (facts.max_time_s !== null) this.max_steps = Math.min(this.max_steps, Math.ceil((facts.max_time_s * 1000) / step_ms - 1e-9));
    if (!this.measures) this.max_steps = Math.min(this.max_steps, Math.ceil(this.max_cycles * this.steps_a_cycle));
    this.period_s = period / 1000;
  }

  /** Begin the trial with a seed. @param {bigint} seed */
  reset(seed) {
    const { kernels, facts, groups } = this, [block, addresses] = [this.swarm.slice(0, 7), this.swarm.slice(7)];
    this.seed = seed;
    this.block.bytes.set(this.beginning);
    kernels.call("draw_all", ...block, ...this.seeds.words(seed), ...this.scratch);
    for (const streams of this.own.streams) this.seeds.draw(seed, streams, this.block.bytes);
    if (this.get("scene", "robots_vary")) kernels.call("vary", ...block);
    kernels.call("begin_placement", ...block);
    for (const placement of ["grid", "random"])
      groups.forEach((/** @type {any} */ group, /** @type {number} */ number) => {
        if (facts.placements[number] !== placement) return;
        kernels.call(`place_${placement === "grid" ? "on_grid" : "at_random"}`, ...block, BigInt(group.first), BigInt(group.first + group.count));
        if (kernels.whole() !== -1) throw new Error("The robots do not fit into the arena: take fewer robots, or a larger arena.");
      });
    kernels.call("place", ...block, ...addresses);
    groups.forEach((/** @type {any} */ _, /** @type {number} */ number) => {
      if (facts.takes_pictures[number]) kernels.call("begin_pictures", ...block, BigInt(number));
      kernels.call(this.own.functions[this.get("group", "controller", number)], ...this.swarm, BigInt(number));
      this.set_memory(number);
    });
    this.set("scene", "starts", 0, 0);
    /** @type {number} */
    this.steps = 0;
    /** @type {number} */
    this.cycles = 0;
    /** @type {number | null} */
    this.order = null;
    /** @type {number[] | null} of synchrony: cycles and order parameter */
    this.synchrony = null;
    this.goes_on = false;
    this.time_s = 0;
    /** @type {Float64Array} */
    this.before = this.poses();
    /** @type {Float64Array} */
    this.last = this.before;
    this.lit = new Uint8Array(this.count);
    this.dark = new Set();
  }

  /** Write the memory at the start of a group's robots, as far as the scenario gives it. @param {number} number */
  set_memory(number) {
    const group = this.groups[number];
    for (const [name, given] of Object.entries(this.facts.memory[number])) {
      const [offset, kind] = this.facts.memories[number][name];
      for (let member = 0; member < group.count; member++)
        this.block.write(group.memory + member * group.size + offset, kind, Array.isArray(given) ? given[member] : given);
    }
  }

  /** Take control steps; return whether the reference fires in the last of them. @param {number} steps @param {boolean} untilFiring */
  take(steps, untilFiring) {
    this.kernels.call("take_steps", ...this.swarm, BigInt(steps), untilFiring ? 1 : 0);
    const outcome = this.kernels.whole();
    if (outcome >= 0) throw new Error(`The controller of robot ${outcome} set a speed or a turn that is not a number.`);
    this.steps = this.get("scene", "step") + 1;
    if (!this.measures) this.cycles = Math.floor(this.steps / this.steps_a_cycle);
    else if (outcome === FIRED) this.count_firing();
  }

  count_firing() {
    this.cycles += 1;
    this.order = this.measure();
    const { order_parameter: threshold } = this.facts;
    if (!this.synchrony && threshold !== null && this.order >= threshold && this.oscillators.length > 1) this.synchrony = [this.cycles, this.order];
  }

  /** Return the order parameter now. */
  measure() {
    const { kernels, oscillators, sums } = this, count = oscillators.length, { buffer } = kernels.memory;
    const phase = (/** @type {{at: number, kind: string}} */ { at, kind }) => this.block.read(at, kind);
    const own = this.reference && this.facts.metric === "reference" ? phase(this.reference) / this.reference.period : 0;
    const angles = oscillators.map((each) => (2 * Math.PI * (phase(each) - own * each.period)) / each.period);
    const found = new Float64Array(buffer, sums, 2);
    found.fill(0);
    new Float64Array(buffer, sums + 16, count).set(angles);
    kernels.call("add_directions", ...Kernels.rows(sums, 2, 1), ...Kernels.rows(sums + 16, 1, count));
    const [sine, cosine] = [found[0] / count, found[1] / count];
    return this.facts.metric === "reference" ? cosine : Math.sqrt(sine * sine + cosine * cosine);
  }

  get is_synchronised() {
    return this.synchrony !== null;
  }

  get has_ended() {
    if (this.cycles >= this.max_cycles || this.steps >= this.max_steps) return true;
    return !this.goes_on && this.synchrony !== null && this.cycles >= this.synchrony[0] + this.facts.further_cycles;
  }

  /** Simulate beyond synchrony. */
  go_on() {
    this.goes_on = true;
  }

  /** Run the present trial to its end, in slices. @returns {Generator<number, Result>} */
  *run() {
    while (!this.has_ended) {
      for (let slice = 0; slice < SLICE && !this.has_ended; slice++) {
        let end = this.max_steps;
        if (!this.measures) end = Math.min(end, Math.ceil((this.cycles + 1) * this.steps_a_cycle));
        this.take(Math.min(Math.max(end - this.steps, 1), UNSEEN_STEPS), true);
      }
      yield this.cycles;
    }
    return this.finish();
  }

  /** Return how the trial has ended. @returns {Result} */
  finish() {
    const [cycles, order] = this.synchrony ?? [this.cycles, this.order];
    return { seed: this.seed, cycles: cycles ?? 0, is_synchronised: this.is_synchronised, order_parameter: order, steps: this.steps, time_s: (this.steps * this.facts.step_ms) / 1000 };
  }

  /** Simulate up to a time, or to the end of the trial; call `tell` at each flash. */
  /** @param {number} time_s @param {(time_s: number, robot: number) => void} tell */
  advance_to(time_s, tell) {
    while (!this.has_ended && (this.steps - 1) * this.step_s < time_s) {
      this.take(1, false);
      [this.before, this.last] = [this.last, this.poses()];
      if (this.steps === 1) this.before = this.last;
      const at = this.facts.robot.ring_command[0];
      for (let robot = 0; robot < this.count; robot++) {
        const place = this.record("robot", robot), isLit = this.block.bytes[place + at];
        if (isLit && !this.lit[robot] && !this.dark.has(robot)) tell(Math.max(0, (this.steps - 1) * this.step_s), robot);
        this.lit[robot] = isLit;
        if (this.dark.has(robot)) this.set("robot", "ring_on", robot, 0);
      }
    }
    this.time_s = this.has_ended ? Math.max(0, this.steps - 1) * this.step_s : time_s;
  }

  /** Return x, y and heading of all robots, one after the other. */
  poses() {
    const { robot } = this.facts.bytes, first = this.place_of("robots") + this.facts.robot.x[0], found = new Float64Array(3 * this.count);
    const { view } = this.block;
    for (let number = 0; number < this.count; number++)
      for (let each = 0; each < 3; each++) found[3 * number + each] = view.getFloat64(first + number * robot + 8 * each, true);
    return found;
  }

  /** Return the picture of this moment, between the last two control steps. @returns {Picture} */
  look() {
    const { count, before, last } = this;
    const share = Math.min(Math.max(1 - ((this.steps - 1) * this.step_s - this.time_s) / this.step_s, 0), 1);
    const [x, y, heading, phases] = [0, 1, 2, 3].map(() => new Float64Array(count));
    for (let robot = 0; robot < count; robot++)
      [x, y, heading].forEach((found, each) => (found[robot] = before[3 * robot + each] + share * (last[3 * robot + each] - before[3 * robot + each])));
    phases.fill(NaN);
    for (const { robot, at, kind, period } of this.oscillators) phases[robot] = this.block.read(at, kind) / period;
    const is_lit = Uint8Array.from({ length: count }, (_, robot) => this.get("robot", "ring_on", robot));
    return { x, y, heading, phases, is_lit };
  }

  /** Return the group of a robot, and its number. @param {number} robot */
  group_of(robot) {
    const number = this.groups.findIndex((/** @type {any} */ group) => robot >= group.first && robot < group.first + group.count);
    return { number, group: this.groups[number] };
  }

  /** Return the pixels of a robot's camera, from the left; 1 where it sees a lit ring. @param {number} robot */
  camera(robot) {
    const { group } = this.group_of(robot), at = this.place_of("pixels") + 8 * (group.row + (robot - group.first) * group.pixels);
    return Uint8Array.from(new BigInt64Array(this.kernels.memory.buffer, this.block.first + at, group.pixels), Number);
  }

  /** Return the readings of a robot's proximity sensors, counts. @param {number} robot */
  infrared(robot) {
    return this.block.floats(this.record("robot", robot) + this.facts.robot["sensors.infrared"][0], 8).slice();
  }

  /** Return a robot's memory, by name. @param {number} robot @returns {[string, number][]} */
  memory(robot) {
    const { group, number } = this.group_of(robot), first = group.memory + (robot - group.first) * group.size;
    /** @type {[string, [number, string]][]} */
    const fields = Object.entries(this.facts.memories[number]);
    return fields.map(([name, [offset, kind]]) => [name, this.block.read(first + offset, kind)]);
  }

  /** Put a robot elsewhere, within the walls. @param {number} robot @param {number} x @param {number} y */
  put(robot, x, y) {
    const radius = this.radii[robot], inside = (/** @type {number} */ place, /** @type {number} */ side) => Math.min(Math.max(place, radius), side - radius);
    this.set("robot", "x", robot, inside(x, this.values["arena.width_cm"]));
    this.set("robot", "y", robot, inside(y, this.values["arena.height_cm"]));
    this.kernels.call("rest", ...this.swarm, BigInt(robot));
    this.before = this.last = this.poses();
  }

  /** Shift the phase of a robot, up to that at which it fires. @param {number} robot @param {number} cycles */
  push(robot, cycles) {
    const found = this.oscillators.find((each) => each.robot === robot);
    if (!found) return;
    const phase = Math.min(this.block.read(found.at, found.kind) + cycles * found.period, found.period);
    this.block.write(found.at, found.kind, found.kind === "f8" ? phase : Math.round(phase));
  }
}
