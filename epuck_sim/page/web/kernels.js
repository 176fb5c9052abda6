"use strict";
// The program's kernels as WebAssembly, and the blocks of memory that they use. Runs in pages, in workers and in node.

/** @typedef {{[key: string]: any}} Values of keys of a scenario */
/** @typedef {{seed: bigint, cycles: number, is_synchronised: boolean, order_parameter: number | null, steps: number, time_s: number}} Result of a trial */
/** @typedef {{x: Float64Array, y: Float64Array, heading: Float64Array, phases: Float64Array, is_lit: Uint8Array | null}} Picture of a swarm: cm, rad, and shares of a period */
/** @typedef {{[name: string]: [offset: number, kind: string]}} Fields place of each field in a record, and kind of its numbers */

/** Statuses of numba's functions that have returned a value, or None. */
const FINE = [0, -2];

/** End of the part of the memory that build.py gives to the module of a scenario's own files. */
const OWN_END = 19 * 2 ** 20;

/** @typedef {[WebAssembly.Module, WebAssembly.Module | null]} Modules of the model, and of the scenario's own files */

/** An instance of a module: its memory, of which parts are handed out, and its functions. */
class Kernels {
  /** @param {Modules} modules */
  constructor([module, own]) {
    const { exports } = new WebAssembly.Instance(module, {});
    this.functions = /** @type {{[name: string]: (...given: any[]) => any}} */ ({ ...exports });
    this.memory = /** @type {WebAssembly.Memory} */ (exports.memory);
    this.table = /** @type {WebAssembly.Table} */ (exports.__indirect_function_table);
    this.functions._initialize();
    /** @type {Map<string, number>} */
    this.addresses = new Map();
    this.result = this.take(64);
    this.has_own = own !== null;
    if (own) this.add(own);
  }

  /** Add the functions of a module that has its place in the same memory. @param {WebAssembly.Module} own */
  add(own) {
    this.memory.grow(Math.max(0, OWN_END - this.memory.buffer.byteLength) / 65536);
    const { exports } = new WebAssembly.Instance(own, { env: { memory: this.memory } });
    const functions = /** @type {{[name: string]: () => void}} */ (exports);
    functions._initialize();
    Object.assign(this.functions, { ...functions, ...this.functions });
  }

  /** Allocate a part of the memory, filled with zeros. @param {number} bytes */
  take(bytes) {
    const first = this.functions.take(bytes);
    if (!first) throw new Error("there is not enough memory");
    return first;
  }

  /** Return the address by which others call a function: its index in the table. @param {string} name */
  address(name) {
    let index = this.addresses.get(name);
    if (index === undefined) {
      index = this.table.grow(1);
      this.table.set(index, this.functions[name]);
      this.addresses.set(name, index);
    }
    return index;
  }

  /** Return an array as kernels take it. @param {number} first @param {number} length @param {number} bytes of each */
  static array(first, length, bytes) {
    return [0, 0, BigInt(length), BigInt(bytes), first, BigInt(length), BigInt(bytes)];
  }

  /** Return rows of floats as kernels take them. @param {number} first @param {number} rows @param {number} length of each */
  static rows(first, rows, length) {
    return [0, 0, BigInt(rows * length), 8n, first, BigInt(rows), BigInt(length), BigInt(8 * length), 8n];
  }

  /** Call a kernel. @param {string} name @param {any[]} given */
  call(name, ...given) {
    const status = this.functions[name](this.result, this.result + 32, ...given); // 32: place for its exception
    if (FINE.includes(status)) return;
    throw new Error(this.has_own ? "The scenario's own code has failed; `epuck-sim run` says where." : `the kernel ${name} has failed (${status})`);
  }

  /** Return the whole number that the last kernel returned. */
  whole() {
    return Number(new DataView(this.memory.buffer).getBigInt64(this.result, true));
  }
}

/** A part of a kernel's memory with records in it. */
class Block {
  /** @param {Kernels} kernels @param {number} size in bytes */
  constructor(kernels, size) {
    this.kernels = kernels;
    this.size = size;
    this.first = kernels.take(size);
  }

  /** Bytes of the block; get them anew for each use, as memory moves when it grows. */
  get bytes() {
    return new Uint8Array(this.kernels.memory.buffer, this.first, this.size);
  }

  get view() {
    return new DataView(this.kernels.memory.buffer, this.first, this.size);
  }

  /** @param {number} offset @param {number} length */
  floats(offset, length) {
    return new Float64Array(this.kernels.memory.buffer, this.first + offset, length);
  }

  /** @param {number} offset @param {string} kind */
  read(offset, kind) {
    if (kind === "f8") return this.view.getFloat64(offset, true);
    if (kind === "?") return this.bytes[offset];
    return Number(kind === "i8" ? this.view.getBigInt64(offset, true) : this.view.getBigUint64(offset, true));
  }

  /** @param {number} offset @param {string} kind @param {number} value */
  write(offset, kind, value) {
    if (kind === "f8") this.view.setFloat64(offset, value, true);
    else if (kind === "?") this.bytes[offset] = value ? 1 : 0;
    else this.view.setBigInt64(offset, BigInt(value), true);
  }
}

/** Return the 32-bit words of a seed, one after the other in 64 bits each, as the program splits it. @param {bigint} seed */
function seedWords(seed) {
  const words = [];
  do {
    words.push(seed & 0xffffffffn);
    seed >>= 32n;
  } while (seed > 0n);
  return new BigUint64Array(words);
}

/** Seeds of trials, as `run --trials` gives them: that of trial 0 is the master seed. */
class Seeds {
  /** @param {Kernels} kernels */
  constructor(kernels) {
    this.block = new Block(kernels, 512);
  }

  /** Write the words of a seed into the kernels' memory; return them as kernels take an array. @param {bigint} seed */
  words(seed) {
    const words = seedWords(seed);
    new BigUint64Array(this.block.kernels.memory.buffer, this.block.first, words.length).set(words);
    return Kernels.array(this.block.first, words.length, 8);
  }

  /** Return the seed sequence of a seed, or of the child that `keys` lead to. @param {bigint} seed @param {number[]} keys */
  sequence(seed, keys) {
    const { kernels, first } = this.block, sequence = Kernels.array(first + 256, 5, 8);
    kernels.call("begin_sequence", ...sequence, ...this.words(seed));
    for (const key of keys) kernels.call("spawn", ...sequence, ...sequence, BigInt(key));
    return sequence;
  }

  /** @param {bigint} master @param {number} trial */
  of(master, trial) {
    if (trial === 0) return master;
    const { kernels, first } = this.block;
    kernels.call("draw_words", ...Kernels.array(first + 384, 1, 8), ...this.sequence(master, [trial]));
    return this.block.view.getBigUint64(384, true) >> 11n;
  }

  /** Write streams of random numbers into the bytes of a swarm, as `OwnSensor.draw_streams` does. */
  /** @param {bigint} seed @param {{at: number, bytes: number, robot: number, keys: number[]}} streams @param {Uint8Array} bytes */
  draw(seed, { at, bytes: length, robot, keys }, bytes) {
    const first = 32 * robot, end = first + length, { kernels } = this.block;
    if (!this.drawn || this.drawn.size < end) this.drawn = new Block(kernels, end);
    kernels.call("draw_words", ...Kernels.array(this.drawn.first, end / 8, 8), ...this.sequence(seed, keys));
    bytes.set(this.drawn.bytes.subarray(first, end), at);
  }
}
